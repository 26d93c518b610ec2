"""The signs of standing and of flying: pure comparisons of one instant."""

from typing import NamedTuple

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
    thrust: float  # [-] Asked of the rotors
    height: float  # [m] Above the place of lift-off
    led_down: float  # [m/s] Sink speed asked for; infinite where nothing leads the height
    sink_accuracy: float = 0.0  # [m/s] Of the vertical velocity, one sigma


_LED_DOWN = 0.1  # [m/s] Slower is no descent
_FOLLOWED_SHARE = 0.5  # Of the sink speed asked for: what sinks faster follows it
_STILL_SIGMAS = 3.0  # Within so many of its deviations a velocity may be none
_LARGEST_STILL = 1.0  # [m/s] What falls is faster within a fraction of the trigger time
_LIFT_SPEED = 0.3  # [m/s] Up
_LIFT_HEIGHT = 0.3  # [m]
_FALL_SPEED = 1.0  # [m/s] No vehicle that stands moves so fast
_CLEAR_HEIGHT = 1.0  # [m]


def touches_ground(seen: Observation, limits: Thresholds) -> bool:
    """Led down, it neither rises nor sinks although the rotors do not carry it.

    Something else does then. Without an order to descend a low thrust means a wrong belief of
    the weight or a gust, never the ground (PX4, MulticopterLandDetector). A velocity of which
    little is known, for want of an accelerometer or of a height, shows motion only beyond its
    deviation; with such a thrust a vehicle in the air falls, and is soon beyond it.
    """
    north, east, down = seen.velocity_ned
    still = min(limits.vertical_speed, _FOLLOWED_SHARE * seen.led_down)
    still = max(still, min(_STILL_SIGMAS * seen.sink_accuracy, _LARGEST_STILL))
    return (
        seen.led_down > _LED_DOWN
        and seen.thrust <= limits.thrust
        and abs(down) < still
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
