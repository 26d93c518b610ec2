"""What a simulated vehicle sends of itself, as MAVLink messages."""

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dst.vehicles.flight import HOME, Truth, place

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


class Spoiled(NamedTuple):
    """A quantity that a sensor measures no more, and what is sent for it."""

    quantity: str
    real: float
    """In fields of real numbers."""
    share: float
    """In fields of integers: 1 is the largest value of the type, -1 the smallest, 0 is zero."""


QUANTITIES: Final[Mapping[str, Mapping[str, tuple[str, ...]]]] = {
    "attitude": {"ATTITUDE": ("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed")},
    "heading": {"GLOBAL_POSITION_INT": ("hdg",), "ATTITUDE": ("yaw",)},
    "velocity": {"GLOBAL_POSITION_INT": ("vx", "vy", "vz")},
    "place": {"GLOBAL_POSITION_INT": ("lat", "lon")},
    "altitude": {"GLOBAL_POSITION_INT": ("alt", "relative_alt")},
    "home": {"HOME_POSITION": ("latitude", "longitude", "altitude", "x", "y", "z")},
    "battery": {
        "BATTERY_STATUS": ("battery_remaining", "time_remaining", "current_battery"),
        "SYS_STATUS": ("battery_remaining", "voltage_battery", "current_battery"),
    },
    "GPS": {"GPS_RAW_INT": ("lat", "lon", "alt", "eph", "epv", "satellites_visible")},
    "estimate": {"EKF_STATUS_REPORT": ("velocity_variance", "pos_horiz_variance")},
}
"""Fields by message, of each quantity that may be no number."""
REALS: Final = (math.nan, math.inf, -math.inf, 1e38, -1e38)
SHARES: Final = (1.0, -1.0, 0.0)


def spoil(message: Any, spoiled: Spoiled | None) -> Any:
    """Replace the fields of a quantity in a message."""
    if spoiled is None:
        return message
    for name in QUANTITIES[spoiled.quantity].get(message.get_type(), ()):
        kind = message.fieldtypes[message.fieldnames.index(name)]
        setattr(message, name, spoiled.real if kind == "float" else _extreme(kind, spoiled.share))
    return message


def _extreme(kind: str, share: float) -> int:
    """Give a value of an integer type, such as int16_t."""
    bits = int("".join(filter(str.isdigit, kind)))
    if kind.startswith("u"):
        return (2**bits - 1) if share > 0.0 else 0
    return int(share * (2 ** (bits - 1) - 1)) - (share < 0.0)


def attitude(boot_ms: int, yaw_rad: float) -> Any:
    """Level, at rest."""
    return mavlink.MAVLink_attitude_message(boot_ms, 0.0, 0.0, yaw_rad, *[0.0] * 3)


def gps(boot_ms: int, truth: Truth | None) -> Any:
    """A fix at the place by truth; None: no fix."""
    fix = mavlink.GPS_FIX_TYPE_NO_FIX if truth is None else mavlink.GPS_FIX_TYPE_3D_FIX
    latitude_e7 = longitude_e7 = altitude_mm = 0
    if truth is not None:
        latitude_deg, longitude_deg = place(truth.north_m, truth.east_m)
        latitude_e7, longitude_e7 = round(latitude_deg * 1e7), round(longitude_deg * 1e7)
        altitude_mm = round((HOME[2] + truth.height_m) * 1e3)
    satellites = 0 if truth is None else 14
    where = latitude_e7, longitude_e7, altitude_mm
    return mavlink.MAVLink_gps_raw_int_message(
        boot_ms * 1000, fix, *where, *(100, 100, 0, 0), satellites
    )


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
        | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    hashes = [[0] * 8] * 3
    return mavlink.MAVLink_autopilot_version_message(
        capabilities, VERSION, 0, 0, 0, *hashes, vendor, product, serial
    )
