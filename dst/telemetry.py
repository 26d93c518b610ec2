"""What a simulated vehicle sends of itself, as MAVLink messages."""

import math
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dst.flight import HOME, Truth, place

HEALTHY: Final = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_PREARM_CHECK
)
UNKNOWN_E7: Final = 2**31 - 1
"""Latitude and longitude of a vehicle that does not know them."""
VERSION: Final = 1 << 24 | 14 << 16
_MILLIVOLT: Final = 12000
_CENTIAMPERE: Final = 100
_UNMEASURED: Final = 65535, -1, -1
"""Voltage, current and share of a battery that is not measured, as MAVLink writes them."""


def attitude(boot_ms: int, *, is_known: bool) -> Any:
    """Level, or no numbers."""
    values = [0.0 if is_known else math.nan] * 6
    return mavlink.MAVLink_attitude_message(boot_ms, *values)


def position(boot_ms: int, height_m: float, truth: Truth | None) -> Any:
    """The place by truth; None: not known."""
    latitude_e7 = longitude_e7 = UNKNOWN_E7
    if truth is not None:
        latitude_e7, longitude_e7 = (
            round(degrees * 1e7) for degrees in place(truth.north_m, truth.east_m)
        )
    height_mm = round(height_m * 1e3)
    altitude_mm = round(HOME[2] * 1e3) + height_mm
    return mavlink.MAVLink_global_position_int_message(
        boot_ms, latitude_e7, longitude_e7, altitude_mm, height_mm, *(0, 0, 0, 0)
    )


def home_position() -> Any:
    """Where it returns to."""
    home = round(HOME[0] * 1e7), round(HOME[1] * 1e7), round(HOME[2] * 1e3)
    return mavlink.MAVLink_home_position_message(
        *home, *[0.0] * 3, [1.0, 0.0, 0.0, 0.0], *[0.0] * 3
    )


def landed(*, is_flying: bool) -> Any:
    """Whether it is off the ground."""
    flying, standing = mavlink.MAV_LANDED_STATE_IN_AIR, mavlink.MAV_LANDED_STATE_ON_GROUND
    return mavlink.MAVLink_extended_sys_state_message(0, flying if is_flying else standing)


def system_status(share: float | None, *, is_motor_failed: bool) -> Any:
    """Sensors, and the share of the battery that is left; None: nothing of it is measured."""
    failed = mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS if is_motor_failed else 0
    sensors = HEALTHY, HEALTHY, HEALTHY & ~failed
    power = _UNMEASURED
    if share is not None:
        power = _MILLIVOLT, _CENTIAMPERE, round(share * 100)
    return mavlink.MAVLink_sys_status_message(*sensors, 0, *power, *[0] * 6)


def battery(share: float | None) -> Any:
    """The battery, of which a share is left; None: nothing of it is measured."""
    voltage, current, percent = _UNMEASURED
    if share is not None:
        voltage, current, percent = _MILLIVOLT, _CENTIAMPERE, round(share * 100)
    cells = [voltage] + [65535] * 9
    return mavlink.MAVLink_battery_status_message(0, 1, 1, 32767, cells, current, 0, -1, percent)


def estimate() -> Any:
    """An estimator that knows where it is."""
    flags = mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_POS_HORIZ_ABS
    return mavlink.MAVLink_ekf_status_report_message(flags, *[0.1] * 5)


def version(vendor: int, product: int, serial: int) -> Any:
    """What kind of autopilot it is, and which aircraft."""
    capabilities = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    hashes = [[0] * 8] * 3
    return mavlink.MAVLink_autopilot_version_message(
        capabilities, VERSION, 0, 0, 0, *hashes, vendor, product, serial
    )
