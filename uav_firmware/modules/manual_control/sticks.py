"""From a stick's deflection to a share of full effect: dead zone, curve, round gate. Pure.

Every function is odd, rises with the deflection, and maps -1..1 onto itself.
"""

import math
from typing import NamedTuple

from uav_firmware.msg.control_mode import ManualControlSetpoint


class Curves(NamedTuple):
    """Dead zone and curves of the four axes."""

    dead_zone: float  # [-] 0 to below 1
    horizontal: float  # [-] 0 straight to 1 cubic
    vertical: float  # [-]
    yaw: float  # [-]


def dead_zoned(deflection: float, dead_zone: float) -> float:
    """Zero near the centre; the rest is stretched, so that there is no step at its edge."""
    beyond = abs(deflection) - dead_zone
    return 0.0 if beyond <= 0.0 else math.copysign(beyond / (1.0 - dead_zone), deflection)


def curved(deflection: float, expo: float) -> float:
    """Finer about the centre: a mix of straight (`expo` 0) and cubic (1)."""
    return deflection * (1.0 - expo + expo * deflection * deflection)


def in_circle(x: float, y: float) -> tuple[float, float]:
    """Both sticks together never exceed full deflection; their direction is kept."""
    length = math.hypot(x, y)
    return (x, y) if length <= 1.0 else (x / length, y / length)


def shaped(sticks: ManualControlSetpoint, curves: Curves) -> ManualControlSetpoint:
    """Sticks with dead zone, curves and the round gate."""
    zone = curves.dead_zone
    forward, right = in_circle(
        curved(dead_zoned(sticks.forward, zone), curves.horizontal),
        curved(dead_zoned(sticks.right, zone), curves.horizontal),
    )
    return ManualControlSetpoint(
        sticks.time_us,
        forward,
        right,
        curved(dead_zoned(sticks.up, zone), curves.vertical),
        curved(dead_zoned(sticks.yaw, zone), curves.yaw),
    )


def turned(forward: float, right: float, yaw: float) -> tuple[float, float]:
    """A vector of the nose's frame as north and east; yaw [rad]."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return (forward * cosine - right * sine, forward * sine + right * cosine)
