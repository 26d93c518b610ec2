"""Motion as polynomials: its limits, its pieces, and coming to rest.

A motion is a row of pieces, each a polynomial of degree four in time for all three axes.
Horizontal and vertical limits apply to their own parts of each vector. Frames: NED, SI.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from uav_firmware.lib.speed_profile import Limits, Phase
from uav_firmware.lib.vector import ZERO, add, norm, scale
from uav_firmware.msg.vectors import Vector3

_FLAT = 1e-6  # share of a unit vector below which it has no part in a plane


class MotionLimits(NamedTuple):
    """Limits of the vehicle's motion; jerk applies to the whole vector."""

    speed_horizontal: float  # [m/s]
    speed_up: float  # [m/s]
    speed_down: float  # [m/s]
    acceleration_horizontal: float  # [m/s^2]
    acceleration_up: float  # [m/s^2]
    acceleration_down: float  # [m/s^2]
    jerk: float  # [m/s^3]


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
    return Limits(
        least(limits.speed_horizontal, limits.speed_up if climbing else limits.speed_down),
        least(limits.acceleration_horizontal, acceleration),
        limits.jerk,
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


def stop_piece(state: MotionState, limits: MotionLimits) -> Piece | None:
    """Come to rest from any motion; None when already at rest.

    The velocity follows the cubic Hermite polynomial from its present value and slope to zero.
    """
    _, velocity, acceleration = state
    speed, pull = norm(velocity), norm(acceleration)
    if speed < 1e-6 and pull < 1e-6:
        return None
    ceiling = min(limits.acceleration_horizontal, limits.acceleration_up, limits.acceleration_down)
    # With x = t / T the acceleration is v / T (6 x^2 - 6 x) + a (3 x^2 - 4 x + 1), of which the
    # first is at most 3/2 v / T and the second at most a / 3 where it adds to it; the jerk is
    # greatest at the beginning, 6 v / T^2 + 4 a / T.
    duration = max(
        1.5 * speed / max(ceiling - pull / 3.0, 0.5 * ceiling),
        (4.0 * pull + math.sqrt(16.0 * pull * pull + 24.0 * limits.jerk * speed))
        / (2.0 * limits.jerk),
    )
    return Piece(
        duration,
        *state,
        add(scale(velocity, -6.0 / duration**2), scale(acceleration, -4.0 / duration)),
        add(scale(velocity, 12.0 / duration**3), scale(acceleration, 6.0 / duration**2)),
    )
