"""A point that a wanted velocity pushes about and that the vehicle follows.

The acceleration of the point seeks the wanted velocity and changes by no more than the jerk
limit; velocity and position are its integrals. So a wanted velocity of zero brakes to rest and
holds the place, and position, velocity and acceleration always agree. The point waits for a
vehicle that cannot follow: it is never further away than a leash. Frames: NED, SI.
"""

import math
from typing import Final, NamedTuple

from uav_firmware.lib.rotation import wrap_pi
from uav_firmware.lib.vector import ZERO, scale, subtract
from uav_firmware.msg.vectors import Vector3

LONGEST_STEP_S: Final = 0.1
"""[s] A longer pause counts as this, so that no setpoint jumps."""
VERTICAL_LEASH_M: Final = 1.0
"""[m] Of setpoints led by sticks or a stream."""

_YAW_LEASH: Final = math.radians(30.0)  # [rad] Largest lead of a heading setpoint
_SEEK: Final = 3.0  # [1/s] Acceleration per velocity error
_APPROACH: Final = 0.8  # [1/s] Speed per distance, near the place
_REST_SPEED: Final = 1e-3  # [m/s] Below it, when rest is wanted, the point stands


class GuideLimits(NamedTuple):
    """How the point may move."""

    acceleration_horizontal: float  # [m/s^2]
    acceleration_up: float  # [m/s^2]
    acceleration_down: float  # [m/s^2]
    jerk: float  # [m/s^3]
    leash_horizontal: float  # [m]
    leash_vertical: float  # [m]


class Guide:
    """The point's motion."""

    __slots__ = ("acceleration", "position", "velocity")

    def __init__(self) -> None:
        self.restart(ZERO, ZERO)

    def restart(self, position: Vector3, velocity: Vector3) -> None:
        """Put the point at a place [m], moving [m/s]."""
        self.position = position
        self.velocity = velocity
        self.acceleration: Vector3 = ZERO

    def shift(self, position: Vector3, velocity: Vector3) -> None:
        """Move the point with an estimate that was reset by a step [m] and [m/s]."""
        self.position = _plus(self.position, position, 1.0)
        self.velocity = _plus(self.velocity, velocity, 1.0)

    def advance(
        self, wanted_velocity: Vector3, vehicle: Vector3, limits: GuideLimits, dt: float
    ) -> None:
        """Advance by `dt` [s]; `vehicle` is the position of the vehicle [m]."""
        wanted = _wanted_acceleration(wanted_velocity, self.velocity, limits)
        self.acceleration = _towards(self.acceleration, wanted, limits.jerk * dt)
        before = self.velocity
        self.velocity = _plus(before, self.acceleration, dt)
        self._settle(wanted_velocity)
        mean = _plus(scale(before, 0.5), self.velocity, 0.5)
        self.position = leashed(_plus(self.position, mean, dt), vehicle, limits)

    def _settle(self, wanted_velocity: Vector3) -> None:
        """Come to a real rest, axis by axis, instead of an endless approach to it."""
        velocity, acceleration = list(self.velocity), list(self.acceleration)
        for axis, wanted in enumerate(wanted_velocity):
            if (
                wanted == 0.0
                and abs(velocity[axis]) < _REST_SPEED
                and abs(acceleration[axis]) < 0.1
            ):
                velocity[axis] = acceleration[axis] = 0.0
        self.velocity = (velocity[0], velocity[1], velocity[2])
        self.acceleration = (acceleration[0], acceleration[1], acceleration[2])


def leashed(point: Vector3, vehicle: Vector3, limits: GuideLimits) -> Vector3:
    """The point, no further from the vehicle than the leash; horizontally and vertically."""
    north, east = point[0] - vehicle[0], point[1] - vehicle[1]
    distance = math.hypot(north, east)
    if distance > limits.leash_horizontal:
        share = limits.leash_horizontal / distance
        north, east = north * share, east * share
    down = min(max(point[2] - vehicle[2], -limits.leash_vertical), limits.leash_vertical)
    return (vehicle[0] + north, vehicle[1] + east, vehicle[2] + down)


def approach_speed(distance: float, acceleration: float) -> float:
    """Speed [m/s] towards a place at a distance [m] from which the point still comes to rest.

    In proportion to the distance nearby, by the square root further away, so that the braking
    never needs more than half the acceleration; the other half is for the point's own lag.
    """
    braking = 0.5 * acceleration
    near = braking / _APPROACH**2
    if distance <= near:
        return _APPROACH * distance
    return math.sqrt(2.0 * braking * (distance - 0.5 * near))


def advanced_yaw(yaw: float, rate: float, heading: float, dt: float) -> float:
    """Heading setpoint [rad] that has turned on for `dt` [s] at a rate [rad/s].

    As the point does, it waits for a vehicle that cannot follow: `heading` [rad] is the vehicle's.
    """
    ahead = wrap_pi(yaw + rate * dt - heading)
    return wrap_pi(heading + min(max(ahead, -_YAW_LEASH), _YAW_LEASH))


def _wanted_acceleration(wanted: Vector3, velocity: Vector3, limits: GuideLimits) -> Vector3:
    north = _SEEK * (wanted[0] - velocity[0])
    east = _SEEK * (wanted[1] - velocity[1])
    length = math.hypot(north, east)
    if length > limits.acceleration_horizontal:
        share = limits.acceleration_horizontal / length
        north, east = north * share, east * share
    down = _SEEK * (wanted[2] - velocity[2])
    return (north, east, min(max(down, -limits.acceleration_up), limits.acceleration_down))


def _towards(present: Vector3, wanted: Vector3, step: float) -> Vector3:
    """Move a vector towards another by at most a step."""
    change = subtract(wanted, present)
    length = math.hypot(*change)
    return wanted if length <= step else _plus(present, change, step / length)


def _plus(vector: Vector3, other: Vector3, factor: float) -> Vector3:
    return (
        vector[0] + other[0] * factor,
        vector[1] + other[1] * factor,
        vector[2] + other[2] * factor,
    )
