"""Motion in pieces: its limits, its pieces, coming to rest and bending to another velocity.

A motion is a row of stretches: polynomials of degree four in time for all three axes, and arcs
of a level circle. Horizontal and vertical limits apply to their own parts of each vector.
Frames: NED, SI.
"""

import bisect
import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

from uav_firmware.lib.speed_profile import Limits, Phase, brake
from uav_firmware.lib.vector import ZERO, add, norm, scale, subtract
from uav_firmware.msg.vectors import Vector3

_FLAT = 1e-6  # share of a unit vector below which it has no part in a plane
_SHORTEST_BEND_S = 1e-3  # [s] of a change too small to need any time
_STILL = 1e-6  # [m/s], [m/s^2] Below them a motion is at rest


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
    centre: Vector3,
    radius: float,
    bearing: float,
    phases: Sequence[Phase],
    *,
    speed: float = 0.0,
    slope: float = 0.0,
) -> tuple[Arc, ...]:
    """Pieces of a speed profile along a circle; only the last may go on for ever.

    Args:
        centre: of the circle [m]; its down coordinate is that of the motion.
        radius: [m] positive clockwise seen from above, negative anticlockwise.
        bearing: of the beginning, from the centre [rad].
        phases: the profile.
        speed: at its beginning [m/s].
        slope: acceleration along the circle at its beginning [m/s^2].
    """
    pieces: list[Arc] = []
    for phase in phases:
        arc = Arc(phase.duration, centre, radius, bearing, speed, slope, phase.jerk)
        pieces.append(arc)
        if math.isfinite(phase.duration):
            bearing += arc.length_at(phase.duration) / radius
            speed += (slope + 0.5 * phase.jerk * phase.duration) * phase.duration
            slope += phase.jerk * phase.duration
    return tuple(pieces)


def stop_on(arc: Arc, time: float, limits: MotionLimits) -> tuple[Arc, ...]:
    """Come to rest on the circle, `time` [s] after the beginning of an arc.

    What turns the motion and what brakes it get their parts of acceleration and jerk, as in
    `orbit_speed`.
    """
    speed = arc.speed + (arc.acceleration + 0.5 * arc.jerk * time) * time
    slope = arc.acceleration + arc.jerk * time
    if abs(speed) < _STILL and abs(slope) < _STILL:
        return ()
    size = abs(arc.radius)
    braking = Limits(
        math.inf,
        min(
            limits.acceleration_horizontal / math.sqrt(2.0),
            limits.jerk * size / (9.0 * max(abs(speed), _STILL)),
        ),
        limits.jerk / 3.0,
    )
    bearing = arc.bearing + arc.length_at(time) / arc.radius
    phases = brake(speed, slope, braking)
    return arcs(arc.centre, arc.radius, bearing, phases, speed=speed, slope=slope)


def stop_pieces(state: MotionState, limits: MotionLimits) -> tuple[Piece, ...]:
    """Come to rest from any motion as fast as the limits allow; empty when already at rest.

    The motion along the level velocity, across it and the vertical one are braked at once, each
    by the jerk-limited profile of `speed_profile.brake`. They share the jerk in proportion to
    the slopes that they need, so that their ramps take as long.
    """
    axes = _axes(state)
    across = axes[1].acceleration
    level = limits.acceleration_horizontal
    level = math.sqrt(max(level * level - across * across, 0.25 * level * level))
    upright = min(limits.acceleration_up, limits.acceleration_down)
    slopes = tuple(
        _slope_needed(axis, ceiling, limits.jerk)
        for axis, ceiling in zip(axes, (level, level, upright), strict=True)
    )
    whole = math.hypot(*slopes)
    if whole < _STILL:
        return ()
    profiles: list[tuple[Vector3, list[Phase]]] = []
    for axis, slope in zip(axes, slopes, strict=True):
        jerk = limits.jerk * slope / whole
        if jerk > 0.0:
            ceiling = level if axis.direction[2] == 0.0 else _upright(axis, jerk, limits)
            along_axis = Limits(math.inf, ceiling, jerk)
            phases = brake(axis.speed, axis.acceleration, along_axis)
            profiles.append((axis.direction, phases))
    return _merged(state, profiles)


class _Axis(NamedTuple):
    """The part of a motion in one direction."""

    direction: Vector3  # [-] Unit vector
    speed: float  # [m/s]
    acceleration: float  # [m/s^2]


def _axes(state: MotionState) -> tuple[_Axis, _Axis, _Axis]:
    """Motion along the level velocity, across it, and down."""
    (vn, ve, vd), (an, ae, ad) = state.velocity, state.acceleration
    n, e, size = vn, ve, math.hypot(vn, ve)
    if size < _STILL:
        n, e, size = an, ae, math.hypot(an, ae)
    n, e = (n / size, e / size) if size >= _STILL else (1.0, 0.0)
    return (
        _Axis((n, e, 0.0), vn * n + ve * e, an * n + ae * e),
        _Axis((-e, n, 0.0), ve * n - vn * e, ae * n - an * e),
        _Axis((0.0, 0.0, 1.0), vd, ad),
    )


def _slope_needed(axis: _Axis, ceiling: float, jerk: float) -> float:
    """About the greatest acceleration [m/s^2] of a stop along an axis."""
    pull = abs(axis.acceleration)
    enough = math.sqrt(jerk * abs(axis.speed) + 0.5 * pull * pull)
    return 0.0 if enough < _STILL else max(pull, min(ceiling, enough))


def _upright(axis: _Axis, jerk: float, limits: MotionLimits) -> float:
    """Acceleration [m/s^2] against a vertical motion: upwards when it leads down."""
    released = axis.speed + axis.acceleration * abs(axis.acceleration) / (2.0 * jerk)
    return limits.acceleration_up if released > 0.0 else limits.acceleration_down


def _merged(
    state: MotionState, profiles: Sequence[tuple[Vector3, Sequence[Phase]]]
) -> tuple[Piece, ...]:
    """Pieces of several profiles that run at once, each along its own direction."""
    ends = [
        list(itertools.accumulate(phase.duration for phase in phases)) for _, phases in profiles
    ]
    moments = sorted({0.0}.union(*ends))
    pieces: list[Piece] = []
    for begin, end in itertools.pairwise(moments):
        jerk = ZERO
        for (direction, phases), ended in zip(profiles, ends, strict=True):
            index = bisect.bisect_right(ended, begin)
            if index < len(phases):
                jerk = add(jerk, scale(direction, phases[index].jerk))
        pieces.append(Piece(end - begin, *state, jerk, ZERO))
        state = pieces[-1].end()
    return tuple(pieces)


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
