"""What a scripted vehicle sends of itself, as MAVLink messages."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from tests.support.scripted_judgement import may_arm_here
from tests.support.vehicle_script import HOME
from tests.support.vehicle_wire import Message, mavlink

if TYPE_CHECKING:
    from tests.support.scripted_vehicle import ScriptedVehicle

SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION
    | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    | mavlink.MAV_SYS_STATUS_GEOFENCE
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_SENSOR_PROPULSION
)


def heartbeat(vehicle: "ScriptedVehicle") -> Message:
    script, base = vehicle.script, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    if vehicle.in_mission:
        base |= mavlink.MAV_MODE_FLAG_AUTO_ENABLED
    if vehicle.armed:
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    if vehicle.is_manual:
        base |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
    state = mavlink.MAV_STATE_CRITICAL if vehicle.in_failsafe else mavlink.MAV_STATE_ACTIVE
    return mavlink.MAVLink_heartbeat_message(
        script.vehicle_type, script.autopilot, base, vehicle.custom_mode, state, 3
    )


def _estimate(vehicle: "ScriptedVehicle") -> Message:
    flags = mavlink.EKF_ATTITUDE | (mavlink.EKF_POS_HORIZ_ABS if vehicle.navigates else 0)
    return mavlink.MAVLink_ekf_status_report_message(flags, 0.0, 0.0, 0.0, 0.0, 0.0)


def _position(vehicle: "ScriptedVehicle") -> Message:
    height_mm = round(vehicle.height_m * 1e3) if vehicle.airborne else 0
    latitude, longitude = (round(degrees * 1e7) for degrees in vehicle.place)
    return mavlink.MAVLink_global_position_int_message(
        vehicle.boot_ms,
        latitude,
        longitude,
        round(HOME[2] * 1000) + height_mm,
        height_mm,
        *(round(100.0 * speed_m_s) for speed_m_s in vehicle.velocity_ned),
        0,
    )


def _attitude(vehicle: "ScriptedVehicle") -> Message:
    return mavlink.MAVLink_attitude_message(vehicle.boot_ms, 0.01, -0.02, vehicle.yaw_rad, 0, 0, 0)


def _landed(vehicle: "ScriptedVehicle") -> Message:
    in_air, on_ground = mavlink.MAV_LANDED_STATE_IN_AIR, mavlink.MAV_LANDED_STATE_ON_GROUND
    return mavlink.MAVLink_extended_sys_state_message(0, in_air if vehicle.airborne else on_ground)


def _health(vehicle: "ScriptedVehicle") -> Message:
    script, prearm = vehicle.script, mavlink.MAV_SYS_STATUS_PREARM_CHECK
    may = may_arm_here(vehicle) or not script.readiness_by_mode
    ready = prearm if vehicle.is_ready and may and not script.checks_are_off else 0
    present = prearm if script.has_checks else 0
    return mavlink.MAVLink_sys_status_message(
        present | SENSORS,
        SENSORS if script.checks_are_off else present | SENSORS,
        (ready | SENSORS) & ~vehicle.ill,
        *(0, 12000, 100, 80, 0, 0, 0, 0, 0, 0),
    )


def _battery(vehicle: "ScriptedVehicle") -> Message:
    del vehicle
    return mavlink.MAVLink_battery_status_message(
        0, 1, 1, 32767, [12000] + [65535] * 9, 100, 0, -1, 80
    )


STREAMS: dict[str, Callable[["ScriptedVehicle"], Message]] = {
    "position": _position,
    "attitude": _attitude,
    "landed": _landed,
    "health": _health,
    "battery": _battery,
    "estimate": _estimate,
}
"""By their names in `ScriptedStreams`, the mission left out."""


def home_position(vehicle: "ScriptedVehicle") -> Message:
    return mavlink.MAVLink_home_position_message(
        round(vehicle.home[0] * 1e7),
        round(vehicle.home[1] * 1e7),
        round(vehicle.home[2] * 1e3),
        *(0.0, 0.0, 0.0),
        [1.0, 0.0, 0.0, 0.0],
        *(0.0, 0.0, 0.0),
    )


def autopilot_version(vehicle: "ScriptedVehicle") -> Message:
    script, nothing = vehicle.script, [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        0, script.version, 0, 0, 0, nothing, nothing, nothing, *script.product, 0
    )
