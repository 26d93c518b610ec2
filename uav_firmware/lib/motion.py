"""Motion in pieces: its limits, its pieces, coming to rest and bending to another velocity.

A motion is a row of stretches: polynomials of degree four in time for all three axes, and arcs
of a level circle. Horizontal and vertical limits apply to their own parts of each vector.
Frames: NED, SI.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

from uav_firmware.lib.speed_profile import Limits, Phase
from uav_firmware.lib.vector import ZERO, add, norm, scale, subtract
from uav_firmware.msg.vectors import Vector3

_FLAT = 1e-6  # share of a unit vector below which it has no part in a plane
_SHORTEST_BEND_S = 1e-3  # [s] of a change too small to need any time


class MotionLimits(NamedTuple):
    """Limits of the vehicle's motion; jerk applies to the whole vector."""

    speed_horizontal: float  # [m/s]
    speed_up: float  # [m/s]
    speed_down: float  # [m/s]
    acceleration_horizontal: float  # [m/s^2]
    acceleration_up: float  # [m/s^2]
    acceleration_down: float  # [m/s^2]
    jerk: float  # [m/s^3]
    speed_path: float = math.inf  # [m/s] Along the path, whatever its slope
    jerk_path: float = math.inf  # [m/s^3] Along the path; a stop may be harder


class MotionState(NamedTuple):
    """A point of a motion."""

    position: Vector3  # [m]
    velocity: Vector3  # [m/s]
    acceleration: Vector3  # [m/s^2]


class Piece(NamedTuple):
    """A polynomial stretch, evaluated about its beginning."""

    duration: float  # [s]
    position: Vector3  # [m]
    velocity: Vector3  # [m/s]
    acceleration: Vector3  # [m/s^2]
    jerk: Vector3  # [m/s^3]
    snap: Vector3  # [m/s^4]

    def at(self, time: float) -> MotionState:
        """State `time` [s] after the beginning."""
        t2 = 0.5 * time * time
        t3 = t2 * time / 3.0
        t4 = t3 * time * 0.25
        (px, py, pz), (vx, vy, vz) = self.position, self.velocity
        (ax, ay, az), (jx, jy, jz), (kx, ky, kz) = self.acceleration, self.jerk, self.snap
        return MotionState(
            (
                px + vx * time + ax * t2 + jx * t3 + kx * t4,
                py + vy * time + ay * t2 + jy * t3 + ky * t4,
                pz + vz * time + az * t2 + jz * t3 + kz * t4,
            ),
            (
                vx + ax * time + jx * t2 + kx * t3,
                vy + ay * time + jy * t2 + ky * t3,
                vz + az * time + jz * t2 + kz * t3,
            ),
            (
                ax + jx * time + kx * t2,
                ay + jy * time + ky * t2,
                az + jz * time + kz * t2,
            ),
        )

    def end(self) -> MotionState:
        """State at the end."""
        return self.at(self.duration)


class Arc(NamedTuple):
    """A stretch of a level circle, along which the speed has constant jerk."""

    duration: float  # [s]
    centre: Vector3  # [m]
    radius: float  # [m] Positive clockwise seen from above, negative anticlockwise
    bearing: float  # [rad] From the centre, at the beginning; 0 north, pi/2 east
    speed: float  # [m/s] At the beginning
    acceleration: float  # [m/s^2] Along the circle, at the beginning
    jerk: float  # [m/s^3] Along the circle

    def length_at(self, time: float) -> float:
        """Distance [m] covered `time` [s] after the beginning."""
        half = 0.5 * time * time
        return self.speed * time + self.acceleration * half + self.jerk * half * time / 3.0

    def at(self, time: float) -> MotionState:
        """State `time` [s] after the beginning: p = c + |r| u, v = s' t, a = s'' t - s'^2/|r| u."""
        bearing = self.bearing + self.length_at(time) / self.radius
        speed = self.speed + (self.acceleration + 0.5 * self.jerk * time) * time
        slope = self.acceleration + self.jerk * time
        size, sense = abs(self.radius), math.copysign(1.0, self.radius)
        north, east = math.cos(bearing), math.sin(bearing)  # Unit vector outwards
        inward = speed * speed / size
        return MotionState(
            (self.centre[0] + size * north, self.centre[1] + size * east, self.centre[2]),
            (-sense * speed * east, sense * speed * north, 0.0),
            (
                -sense * slope * east - inward * north,
                sense * slope * north - inward * east,
                0.0,
            ),
        )

    def end(self) -> MotionState:
        """State at the end."""
        return self.at(self.duration)


Stretch: TypeAlias = Piece | Arc
"""Any piece of a motion."""


def along(direction: Vector3, limits: MotionLimits) -> Limits:
    """Limits of motion along a unit vector."""
    horizontal = math.hypot(direction[0], direction[1])
    climbing = direction[2] < 0.0
    vertical = abs(direction[2])

    def least(flat: float, upright: float) -> float:
        return min(
            flat / horizontal if horizontal > _FLAT else math.inf,
            upright / vertical if vertical > _FLAT else math.inf,
        )

    # A leg is both accelerated and braked, so the weaker vertical acceleration counts.
    acceleration = min(limits.acceleration_up, limits.acceleration_down)
    speed = least(limits.speed_horizontal, limits.speed_up if climbing else limits.speed_down)
    return Limits(
        min(speed, limits.speed_path),
        least(limits.acceleration_horizontal, acceleration),
        min(limits.jerk, limits.jerk_path),
    )


def straight_pieces(
    start: MotionState, direction: Vector3, phases: Sequence[Phase]
) -> tuple[Piece, ...]:
    """Pieces of a speed profile along a unit vector; only the last may go on for ever."""
    pieces: list[Piece] = []
    for phase in phases:
        state = pieces[-1].end() if pieces else start
        pieces.append(Piece(phase.duration, *state, scale(direction, phase.jerk), ZERO))
    return tuple(pieces)


def arcs(
    centre: Vector3, radius: float, bearing: float, phases: Sequence[Phase]
) -> tuple[Arc, ...]:
    """Pieces of a speed profile along a circle; only the last may go on for ever.

    Args:
        centre: of the circle [m]; its down coordinate is that of the motion.
        radius: [m] positive clockwise seen from above, negative anticlockwise.
        bearing: of the beginning, from the centre [rad].
        phases: the profile, from rest.
    """
    pieces: list[Arc] = []
    speed = slope = 0.0
    for phase in phases:
        arc = Arc(phase.duration, centre, radius, bearing, speed, slope, phase.jerk)
        pieces.append(arc)
        if math.isfinite(phase.duration):
            bearing += arc.length_at(phase.duration) / radius
            speed += (slope + 0.5 * phase.jerk * phase.duration) * phase.duration
            slope += phase.jerk * phase.duration
    return tuple(pieces)


def stop_piece(state: MotionState, limits: MotionLimits) -> Piece | None:
    """Come to rest from any motion; None when already at rest."""
    if norm(state.velocity) < 1e-6 and norm(state.acceleration) < 1e-6:
        return None
    return bend_piece(state, ZERO, limits)


def bend_piece(state: MotionState, velocity: Vector3, limits: MotionLimits) -> Piece:
    """Bring any motion to a steady velocity [m/s].

    The velocity follows the cubic Hermite polynomial from its present value and slope to the
    velocity wanted, with no slope there. It covers T (v0 + v1) / 2 + a0 T^2 / 12.
    """
    change, acceleration = subtract(state.velocity, velocity), state.acceleration
    speed, pull = norm(change), norm(acceleration)
    # With x = t / T the acceleration is dv / T (6 x^2 - 6 x) + a (3 x^2 - 4 x + 1), of which the
    # first is at most 3/2 dv / T and the second at most a / 3 where it adds to it; the jerk is
    # greatest at the beginning, 6 dv / T^2 + 4 a / T.
    duration = max(
        _bend_time(
            math.hypot(change[0], change[1]),
            math.hypot(acceleration[0], acceleration[1]),
            limits.acceleration_horizontal,
        ),
        _bend_time(
            abs(change[2]),
            abs(acceleration[2]),
            min(limits.acceleration_up, limits.acceleration_down),
        ),
        (4.0 * pull + math.sqrt(16.0 * pull * pull + 24.0 * limits.jerk * speed))
        / (2.0 * limits.jerk),
        _SHORTEST_BEND_S,
    )
    return Piece(
        duration,
        *state,
        add(scale(change, -6.0 / duration**2), scale(acceleration, -4.0 / duration)),
        add(scale(change, 12.0 / duration**3), scale(acceleration, 6.0 / duration**2)),
    )


def _bend_time(change: float, pull: float, ceiling: float) -> float:
    """Time [s] for a change of velocity [m/s] against a present acceleration [m/s^2]."""
    return 1.5 * change / max(ceiling - pull / 3.0, 0.5 * ceiling)
