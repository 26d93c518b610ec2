"""The three modules that see most of the bus: which topic is which of theirs."""

from uav_firmware.modules.commander.topics import CommanderTopics
from uav_firmware.modules.logger.streams import LoggerTopics
from uav_firmware.modules.mavlink.topics import MavlinkTopics
from uav_firmware.topics import Topics


def commander_topics(topics: Topics) -> CommanderTopics:
    """What the commander reads and writes."""
    return CommanderTopics(
        vehicle_command=topics.vehicle_command,
        vehicle_attitude=topics.vehicle_attitude,
        vehicle_local_position=topics.vehicle_local_position,
        estimator_status=topics.estimator_status,
        land_detected=topics.land_detected,
        mission=topics.mission,
        mission_progress=topics.mission_progress,
        navigator_status=topics.navigator_status,
        geofence_status=topics.geofence_status,
        failure_detector_status=topics.failure_detector_status,
        storage_status=topics.storage_status,
        sensors_status=topics.sensors_status,
        sensor_imu=topics.sensor_imu,
        sensor_baro=topics.sensor_baro,
        sensor_mag=topics.sensor_mag,
        sensor_gps=topics.sensor_gps,
        sensor_range=topics.sensor_range,
        battery_status=topics.battery_status,
        ground_station_heartbeat=topics.ground_station_heartbeat,
        manual_control_setpoint=topics.manual_control_setpoint,
        offboard_setpoint=topics.offboard_setpoint,
        vehicle_command_ack=topics.vehicle_command_ack,
        vehicle_status=topics.vehicle_status,
        vehicle_control_mode=topics.vehicle_control_mode,
        home_position=topics.home_position,
        wind=topics.wind,
        navigator_request=topics.navigator_request,
        status_text=topics.status_text,
    )


def mavlink_topics(topics: Topics) -> MavlinkTopics:
    """What the MAVLink module reads and writes."""
    return MavlinkTopics(
        attitude=topics.vehicle_attitude,
        local_position=topics.vehicle_local_position,
        global_position=topics.vehicle_global_position,
        estimator_status=topics.estimator_status,
        gps=topics.sensor_gps,
        imu=topics.sensor_imu,
        baro=topics.sensor_baro,
        battery=topics.battery_status,
        vehicle_status=topics.vehicle_status,
        land_detected=topics.land_detected,
        home=topics.home_position,
        mission_progress=topics.mission_progress,
        trajectory_setpoint=topics.trajectory_setpoint,
        actuator_motors=topics.actuator_motors,
        truth=topics.sensor_truth,
        command_ack=topics.vehicle_command_ack,
        status_text=topics.status_text,
        vehicle_command=topics.vehicle_command,
        mission=topics.mission,
        fence=topics.fence,
        rally_points=topics.rally_points,
        geofence_status=topics.geofence_status,
        orbit_status=topics.orbit_status,
        follow_target=topics.follow_target,
        ground_station_heartbeat=topics.ground_station_heartbeat,
        manual_control_setpoint=topics.manual_control_setpoint,
        offboard_setpoint=topics.offboard_setpoint,
        attitude_setpoint=topics.vehicle_attitude_setpoint,
        rates_setpoint=topics.vehicle_rates_setpoint,
        wind=topics.wind,
        payload_order=topics.payload_order,
        camera_event=topics.camera_event,
        camera_status=topics.camera_status,
        camera_lens=topics.camera_lens,
        gimbal_status=topics.gimbal_status,
        tracking_state=topics.tracking_state,
        mag=topics.sensor_mag,
        range_finder=topics.sensor_range,
        hygrometer=topics.sensor_hygrometer,
        ground_sample=topics.sensor_ground,
        refused_frames=topics.refused_frames,
        log_stream_request=topics.log_stream_request,
        log_stream=topics.log_stream,
    )


def logger_topics(topics: Topics) -> LoggerTopics:
    """What the logger reads."""
    return LoggerTopics(
        attitude=topics.vehicle_attitude,
        local_position=topics.vehicle_local_position,
        global_position=topics.vehicle_global_position,
        estimator_status=topics.estimator_status,
        imu=topics.sensor_imu,
        baro=topics.sensor_baro,
        mag=topics.sensor_mag,
        gps=topics.sensor_gps,
        battery=topics.battery_status,
        trajectory_setpoint=topics.trajectory_setpoint,
        attitude_setpoint=topics.vehicle_attitude_setpoint,
        rates_setpoint=topics.vehicle_rates_setpoint,
        torque_thrust=topics.vehicle_torque_thrust_setpoint,
        allocator_status=topics.control_allocator_status,
        motors=topics.actuator_motors,
        vehicle_status=topics.vehicle_status,
        land_detected=topics.land_detected,
        home=topics.home_position,
        mission_progress=topics.mission_progress,
    )
