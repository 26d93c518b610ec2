"""From SI floats to the integers of the wire, without a value that could break the packing."""

import math
from typing import Final

INT16_MAX: Final = 0x7FFF
INT32_MAX: Final = 0x7FFFFFFF
UINT8_MAX: Final = 0xFF
UINT16_MAX: Final = 0xFFFF
UINT32_MAX: Final = 0xFFFFFFFF
NAN: Final = math.nan


def saturated(value: float, low: int, high: int, unknown: int = 0) -> int:
    """Round to the nearest integer in `low`..`high`; `unknown` stands for NaN."""
    if low <= value <= high:  # The usual case first; NaN compares false
        return round(value)
    if math.isnan(value):
        return unknown
    return low if value < low else high


def int8(value: float, unknown: int = 0) -> int:
    """As a signed byte."""
    return saturated(value, -0x80, 0x7F, unknown)


def int16(value: float, unknown: int = 0) -> int:
    """As a signed 16-bit number."""
    return saturated(value, -0x8000, INT16_MAX, unknown)


def uint16(value: float, unknown: int = UINT16_MAX) -> int:
    """As an unsigned 16-bit number; MAVLink's usual unknown is the maximum."""
    return saturated(value, 0, UINT16_MAX, unknown)


def int32(value: float, unknown: int = 0) -> int:
    """As a signed 32-bit number."""
    return saturated(value, -0x80000000, INT32_MAX, unknown)


def uint32(value: float, unknown: int = 0) -> int:
    """As an unsigned 32-bit number."""
    return saturated(value, 0, UINT32_MAX, unknown)


def degrees_e7(angle_deg: float) -> int:
    """Degrees as MAVLink's 1e-7 degrees."""
    return int32(angle_deg * 1e7)


def millimetres(length_m: float) -> int:
    """Metres as signed millimetres."""
    return int32(length_m * 1e3)


def boot_ms(time_us: int) -> int:
    """Time since boot [us] as `time_boot_ms`, which wraps after 49 days."""
    return time_us // 1000 & UINT32_MAX


def compass_centidegrees(angle: float) -> int:
    """An angle from north [rad] as 0..35999; UINT16_MAX when unknown."""
    if not math.isfinite(angle):
        return UINT16_MAX
    return round(math.degrees(angle) * 100) % 36000
