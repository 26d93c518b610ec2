"""Input of the message builders, and conversion of SI floats to the integers of messages."""

import math
from typing import Final, NamedTuple

from uav_firmware.msg.vectors import Vector3
from uav_firmware.topics import Topics

INT16_MAX: Final = 0x7FFF
INT32_MAX: Final = 0x7FFFFFFF
UINT8_MAX: Final = 0xFF
UINT16_MAX: Final = 0xFFFF
UINT32_MAX: Final = 0xFFFFFFFF
NAN: Final = math.nan


class BatteryThresholds(NamedTuple):
    """Remaining charge, 0 to 1, at or below which each warning applies."""

    low: float
    critical: float
    emergency: float


class Context(NamedTuple):
    """State of the vehicle at one instant, as message builders use it."""

    topics: Topics
    now_us: int  # [us] Since boot
    boot_time_utc_us: int  # [us] Since 1970; 0 when unknown
    system_id: int
    battery_thresholds: BatteryThresholds
    vibration_frd: Vector3  # [m/s^2] Mean change between accelerometer samples


def saturated(value: float, low: int, high: int, unknown: int = 0) -> int:
    """Round to the nearest integer in `low`..`high`; NaN becomes `unknown`."""
    if low <= value <= high:  # The usual case first; NaN compares false
        return round(value)
    if math.isnan(value):
        return unknown
    return low if value < low else high


def int8(value: float, unknown: int = 0) -> int:
    """Convert to int8, saturated."""
    return saturated(value, -0x80, 0x7F, unknown)


def int16(value: float, unknown: int = 0) -> int:
    """Convert to int16, saturated."""
    return saturated(value, -0x8000, INT16_MAX, unknown)


def uint16(value: float, unknown: int = UINT16_MAX) -> int:
    """Convert to uint16, saturated; unknown is usually the maximum in MAVLink."""
    return saturated(value, 0, UINT16_MAX, unknown)


def int32(value: float, unknown: int = 0) -> int:
    """Convert to int32, saturated."""
    return saturated(value, -0x80000000, INT32_MAX, unknown)


def uint32(value: float, unknown: int = 0) -> int:
    """Convert to uint32, saturated."""
    return saturated(value, 0, UINT32_MAX, unknown)


def degrees_e7(angle_deg: float) -> int:
    """Convert degrees to 1e-7 degrees."""
    return int32(angle_deg * 1e7)


def millimetres(length_m: float) -> int:
    """Convert metres to signed millimetres."""
    return int32(length_m * 1e3)


def boot_ms(time_us: int) -> int:
    """Convert time since boot [us] to `time_boot_ms`, which wraps after 49 days."""
    return time_us // 1000 & UINT32_MAX


def compass_centidegrees(angle: float) -> int:
    """Convert an angle from north [rad] to 0..35999; UINT16_MAX when unknown."""
    if not math.isfinite(angle):
        return UINT16_MAX
    return round(math.degrees(angle) * 100) % 36000
