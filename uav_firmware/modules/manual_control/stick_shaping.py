"""Shapes stick deflections: dead zone, expo curve, circular limit. Pure.

Every function is odd, increases with the deflection, and maps -1..1 onto itself.
"""

import math
from typing import NamedTuple

from uav_firmware.msg.control_mode import ManualControlSetpoint


class Curves(NamedTuple):
    """Dead zone and curves of the four axes."""

    dead_zone: float  # [-] 0 to below 1
    horizontal: float  # [-] Expo: 0 linear to 1 cubic
    vertical: float  # [-]
    yaw: float  # [-]


def with_dead_zone(deflection: float, dead_zone: float) -> float:
    """Zero within the dead zone; the rest is scaled so that there is no step at its edge."""
    beyond = abs(deflection) - dead_zone
    return 0.0 if beyond <= 0.0 else math.copysign(beyond / (1.0 - dead_zone), deflection)


def with_expo(deflection: float, expo: float) -> float:
    """Mix of a linear (`expo` 0) and a cubic (1) curve, which is finer about the centre."""
    return deflection * (1.0 - expo + expo * deflection * deflection)


def limited_to_circle(x: float, y: float) -> tuple[float, float]:
    """Shorten a deflection of two axes to length 1 at most; its direction stays."""
    length = math.hypot(x, y)
    return (x, y) if length <= 1.0 else (x / length, y / length)


def shaped(sticks: ManualControlSetpoint, curves: Curves) -> ManualControlSetpoint:
    """Apply dead zone, curves and the circular limit."""
    zone = curves.dead_zone
    forward, right = limited_to_circle(
        with_expo(with_dead_zone(sticks.forward, zone), curves.horizontal),
        with_expo(with_dead_zone(sticks.right, zone), curves.horizontal),
    )
    return ManualControlSetpoint(
        sticks.time_us,
        forward,
        right,
        with_expo(with_dead_zone(sticks.up, zone), curves.vertical),
        with_expo(with_dead_zone(sticks.yaw, zone), curves.yaw),
    )
