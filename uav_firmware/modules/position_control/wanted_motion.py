"""What of a wanted motion can be flown with the present estimate. NaN means unset."""

import math
from typing import Final

from uav_firmware.modules.position_control.controller import Motion
from uav_firmware.msg.estimate import VehicleLocalPosition
from uav_firmware.msg.vectors import Vector3

_NAN: Final = float("nan")
BLIND: Final[Vector3] = (_NAN, _NAN, _NAN)
"""No set-point on any axis."""

LEVEL: Final[Vector3] = (0.0, 0.0, 0.0)
"""No acceleration."""

_SINK_WITHOUT_HEIGHT: Final = 0.3  # [m/s^2] Down: softly, since nothing tells the speed
_CLIMB_HEIGHT: Final = 0.5  # [m] More than a height estimate drifts on the ground
_CLIMB_SPEED: Final = 0.05  # [m/s]


def observable(wanted: Motion, estimate: VehicleLocalPosition) -> Motion:
    """Unset what the estimate cannot observe.

    Without horizontal position the velocity is controlled; without velocity the vehicle stays
    level, unless acceleration alone was asked for; without height it sinks softly.
    """
    if estimate.position_valid and estimate.velocity_valid and estimate.altitude_valid:
        return wanted
    position, velocity, acceleration, speed_max = wanted
    if not (estimate.position_valid and estimate.velocity_valid):
        position = (_NAN, _NAN, position[2])
    if not estimate.velocity_valid:
        if not math.isnan(velocity[0]):
            acceleration = (0.0, 0.0, acceleration[2])  # it belonged to the motion now lost
        velocity = (_NAN, _NAN, velocity[2])
    if not estimate.altitude_valid:
        position = (position[0], position[1], _NAN)
        velocity = (velocity[0], velocity[1], _NAN)
        acceleration = (acceleration[0], acceleration[1], _SINK_WITHOUT_HEIGHT)
    return Motion(position, velocity, acceleration, speed_max)


def wants_climb(wanted: Motion, estimate: VehicleLocalPosition) -> bool:
    """Whether the motion leads upwards from here: the order to take off."""
    height = estimate.position_ned[2] - wanted.position_ned[2]
    speed = -wanted.velocity_ned[2]
    above = not math.isnan(height) and height > _CLIMB_HEIGHT
    rising = not math.isnan(speed) and speed > _CLIMB_SPEED
    return above or rising
