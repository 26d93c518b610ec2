"""The signs of standing and of flying: pure comparisons of one instant."""

from typing import NamedTuple

from uav_firmware.lib.ground_contact import does_not_sink
from uav_firmware.msg.vectors import Vector3


class Thresholds(NamedTuple):
    """What separates standing from flying."""

    vertical_speed: float  # [m/s]
    horizontal_speed: float  # [m/s]
    rotation: float  # [rad/s]
    thrust: float  # [-] At and below it the rotors cannot carry the weight
    lift_thrust: float  # [-] Above it a rising vehicle is lifted by its rotors


class Observation(NamedTuple):
    """What one instant shows."""

    velocity_ned: Vector3  # [m/s]
    rate_frd: Vector3  # [rad/s]
    thrust: float  # [-] Commanded
    height: float  # [m] Above the place of lift-off
    commanded_sink: float  # [m/s] Down; infinite where nothing controls the height
    sink_accuracy: float = 0.0  # [m/s] Of the vertical velocity, one sigma


_LIFT_SPEED = 0.3  # [m/s] Up
_LIFT_HEIGHT = 0.3  # [m]
_FALL_SPEED = 1.0  # [m/s] No vehicle that stands moves so fast
_CLEAR_HEIGHT = 1.0  # [m]


def touches_ground(seen: Observation, limits: Thresholds) -> bool:
    """Commanded to descend, it neither rises nor sinks although the rotors do not carry it.

    Without a commanded descent a low thrust means a wrong estimate of the weight or a gust,
    never the ground (PX4, MulticopterLandDetector).
    """
    north, east, down = seen.velocity_ned
    return (
        seen.thrust <= limits.thrust
        and does_not_sink(
            down, seen.commanded_sink, seen.sink_accuracy, still_max_m_s=limits.vertical_speed
        )
        and north * north + east * east < limits.horizontal_speed**2
    )


def stands(seen: Observation, limits: Thresholds) -> bool:
    """Touches the ground and does not tip over."""
    roll_rate, pitch_rate, _ = seen.rate_frd
    return (
        touches_ground(seen, limits)
        and abs(roll_rate) < limits.rotation
        and abs(pitch_rate) < limits.rotation
    )


def lifts_off(seen: Observation, limits: Thresholds) -> bool:
    """Rises under thrust, or falls."""
    rising = seen.velocity_ned[2] < -_LIFT_SPEED or seen.height > _LIFT_HEIGHT
    return (seen.thrust > limits.lift_thrust and rising) or seen.velocity_ned[2] > _FALL_SPEED


def is_clear(seen: Observation) -> bool:
    """Has left the place of lift-off."""
    return seen.height > _CLEAR_HEIGHT
