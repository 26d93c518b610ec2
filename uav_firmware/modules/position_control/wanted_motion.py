"""What of a wanted motion can be flown with the present estimate. NaN means unset."""

import math
from typing import Final

from uav_firmware.lib.ground_contact import BLIND_DESCENT_M_S
from uav_firmware.modules.position_control.controller import Motion
from uav_firmware.msg.estimate import VehicleLocalPosition
from uav_firmware.msg.vectors import Vector3

_NAN: Final = float("nan")
BLIND: Final[Vector3] = (_NAN, _NAN, _NAN)
"""No setpoint on any axis."""

LEVEL: Final[Vector3] = (0.0, 0.0, 0.0)
"""No acceleration."""

_KNOWN_SINK_M_S: Final = 1.0  # One sigma of a vertical velocity that can be controlled
_CERTAIN_TO_SINK: Final = 2.0  # [SD] Of it: commanded, so that the vehicle descends with any error
_SINK_WITHOUT_SPEED: Final = 0.3  # [m/s^2] Down: softly, since the speed is unknown
_CLIMB_HEIGHT: Final = 0.5  # [m] More than a height estimate drifts on the ground
_CLIMB_SPEED: Final = 0.05  # [m/s]


def observable(wanted: Motion, estimate: VehicleLocalPosition) -> Motion:
    """Unset what the estimate cannot observe.

    Without horizontal position the velocity is controlled; without velocity the vehicle stays
    level, unless acceleration alone was commanded, and what held against the wind goes on. Without
    height it descends: at the commanded speed while the accelerometer gives the vertical velocity,
    softly afterwards.
    """
    if estimate.position_valid and estimate.velocity_valid and estimate.altitude_valid:
        return wanted
    position, velocity, acceleration, speed_max, _ = wanted
    if not (estimate.position_valid and estimate.velocity_valid):
        position = (_NAN, _NAN, position[2])
    if not estimate.velocity_valid:
        if not math.isnan(velocity[0]):
            acceleration = (0.0, 0.0, acceleration[2])  # it belonged to the motion now lost
        velocity = (_NAN, _NAN, velocity[2])
    if not estimate.altitude_valid:
        position = (position[0], position[1], _NAN)
        sink, share = _sink_without_height(velocity[2], estimate.sink_accuracy_m_s)
        velocity = (velocity[0], velocity[1], sink)
        acceleration = (acceleration[0], acceleration[1], share)
    return Motion(position, velocity, acceleration, speed_max, holds=True)


def _sink_without_height(asked_m_s: float, accuracy_m_s: float) -> tuple[float, float]:
    """Velocity [m/s] and acceleration [m/s^2] down of a vehicle without a height estimate."""
    if not accuracy_m_s < _KNOWN_SINK_M_S:
        return _NAN, _SINK_WITHOUT_SPEED
    surely = max(BLIND_DESCENT_M_S, _CERTAIN_TO_SINK * accuracy_m_s)
    return (surely if math.isnan(asked_m_s) else max(asked_m_s, surely)), 0.0


def wants_climb(wanted: Motion, estimate: VehicleLocalPosition) -> bool:
    """Whether the motion leads upwards from here: the order to take off."""
    height = estimate.position_ned[2] - wanted.position_ned[2]
    speed = -wanted.velocity_ned[2]
    above = not math.isnan(height) and height > _CLIMB_HEIGHT
    rising = not math.isnan(speed) and speed > _CLIMB_SPEED
    return above or rising
