"""Setpoints, motors and vehicle state as PX4's messages."""

import math
from typing import Final

from uav_firmware.modules.logger.ulog import Values, declare
from uav_firmware.msg.actuators import ActuatorMotors
from uav_firmware.msg.mission import MissionProgress, MissionState
from uav_firmware.msg.setpoints import (
    ControlAllocatorStatus,
    TrajectorySetpoint,
    VehicleAttitudeSetpoint,
    VehicleRatesSetpoint,
    VehicleTorqueThrustSetpoint,
)
from uav_firmware.msg.status import HomePosition, LandDetected, VehicleStatus

_UNUSED_MOTORS: Final = (math.nan,) * 8  # PX4's message has room for twelve
_ROTARY_WING: Final = 1
_DISARMED: Final = 1
_ARMED: Final = 2


def _position_setpoint(setpoint: TrajectorySetpoint) -> Values:
    return (
        setpoint.time_us,
        *setpoint.position_ned,
        *setpoint.velocity_ned,
        *setpoint.acceleration_ned,
        setpoint.yaw,
        setpoint.yaw_rate,
    )


def _attitude_setpoint(setpoint: VehicleAttitudeSetpoint) -> Values:
    return (setpoint.time_us, *setpoint.q_ned_frd, setpoint.yaw_rate, 0.0, 0.0, -setpoint.thrust)


def _rates_setpoint(setpoint: VehicleRatesSetpoint) -> Values:
    return (setpoint.time_us, *setpoint.rate_frd, 0.0, 0.0, -setpoint.thrust)


def _torque_setpoint(setpoint: VehicleTorqueThrustSetpoint) -> Values:
    return (setpoint.time_us, *setpoint.torque_frd)


def _thrust_setpoint(setpoint: VehicleTorqueThrustSetpoint) -> Values:
    return (setpoint.time_us, 0.0, 0.0, -setpoint.thrust)


def _allocator_status(status: ControlAllocatorStatus) -> Values:
    return (status.time_us, *status.unallocated_torque_frd, 0.0, 0.0, -status.unallocated_thrust)


def _motors(motors: ActuatorMotors) -> Values:
    return (motors.time_us, *motors.control, *_UNUSED_MOTORS)


def _vehicle_status(status: VehicleStatus) -> Values:
    return (
        status.time_us,
        status.armed_since_us,
        _ARMED if status.armed else _DISARMED,
        status.navigation_state,
        status.navigation_state,
        status.failsafe,
        status.preflight_checks_pass,
        _ROTARY_WING,
        False,
        status.sensors_health,
    )


def _land_detected(land: LandDetected) -> Values:
    return (land.time_us, land.ground_contact, land.landed, land.landed, land.landed_state)


def _home_position(home: HomePosition) -> Values:
    return (
        home.time_us,
        home.latitude_deg,
        home.longitude_deg,
        home.altitude_amsl_m,
        *home.position_ned,
        home.yaw,
        True,
        True,
        True,
    )


def _mission_result(progress: MissionProgress) -> Values:
    return (
        progress.time_us,
        progress.mission_id,
        progress.seq_reached,
        progress.seq_current,
        progress.seq_total,
        progress.state != MissionState.NO_MISSION,
        progress.state == MissionState.COMPLETE,
    )


VEHICLE_LOCAL_POSITION_SETPOINT: Final = declare(
    "vehicle_local_position_setpoint",
    "float x; float y; float z; float vx; float vy; float vz; float[3] acceleration; "
    "float yaw; float yawspeed",
    _position_setpoint,
)
TRAJECTORY_SETPOINT: Final = declare(
    "trajectory_setpoint",
    "float[3] position; float[3] velocity; float[3] acceleration; float yaw; float yawspeed",
    _position_setpoint,
)
VEHICLE_ATTITUDE_SETPOINT: Final = declare(
    "vehicle_attitude_setpoint",
    "float[4] q_d; float yaw_sp_move_rate; float[3] thrust_body",
    _attitude_setpoint,
)
VEHICLE_RATES_SETPOINT: Final = declare(
    "vehicle_rates_setpoint",
    "float roll; float pitch; float yaw; float[3] thrust_body",
    _rates_setpoint,
)
VEHICLE_TORQUE_SETPOINT: Final = declare(
    "vehicle_torque_setpoint", "float[3] xyz", _torque_setpoint
)
VEHICLE_THRUST_SETPOINT: Final = declare(
    "vehicle_thrust_setpoint", "float[3] xyz", _thrust_setpoint
)
CONTROL_ALLOCATOR_STATUS: Final = declare(
    "control_allocator_status",
    "float[3] unallocated_torque; float[3] unallocated_thrust",
    _allocator_status,
)
ACTUATOR_MOTORS: Final = declare("actuator_motors", "float[12] control", _motors)
VEHICLE_STATUS: Final = declare(
    "vehicle_status",
    "uint64_t armed_time; uint8_t arming_state; uint8_t nav_state_user_intention; "
    "uint8_t nav_state; bool failsafe; bool pre_flight_checks_pass; uint8_t vehicle_type; "
    "bool is_vtol; uint32_t onboard_control_sensors_health",
    _vehicle_status,
)
VEHICLE_LAND_DETECTED: Final = declare(
    "vehicle_land_detected",
    "bool ground_contact; bool maybe_landed; bool landed; uint8_t landed_state",
    _land_detected,
)
HOME_POSITION: Final = declare(
    "home_position",
    "double lat; double lon; float alt; float x; float y; float z; float yaw; "
    "bool valid_alt; bool valid_hpos; bool valid_lpos",
    _home_position,
)
MISSION_RESULT: Final = declare(
    "mission_result",
    "uint32_t mission_id; int32_t seq_reached; uint16_t seq_current; uint16_t seq_total; "
    "bool valid; bool finished",
    _mission_result,
)
