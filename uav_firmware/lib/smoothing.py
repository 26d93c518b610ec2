"""Flyable motion through waypoints: continuous position, velocity and acceleration.

A motion is a row of pieces, each a polynomial of degree four in time for all three axes. Three
kinds are enough:

* along a straight leg, the double-S profile of `speed_profile`;
* round a waypoint, the velocity turns from v u1 to v u2 by the blend s(x) = 3 x^2 - 2 x^3
  within a time T. It begins and ends v T / 2 from the waypoint, without acceleration, and
  misses the waypoint by 3/32 v T |u2 - u1| at its middle. Acceleration is at most
  3/2 v |u2 - u1| / T and jerk at most 6 v |u2 - u1| / T^2, which gives v in closed form;
* from any motion to rest, the velocity follows the cubic Hermite polynomial from its present
  value and slope to zero.

Horizontal and vertical limits apply to their own parts of each vector. Frames: NED, SI.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from uav_firmware.lib import speed_profile
from uav_firmware.lib.speed_profile import Limits, Phase
from uav_firmware.msg.vectors import Vector3

ZERO: Vector3 = (0.0, 0.0, 0.0)

_SHORTEST_LEG_M = 1e-3  # below it a leg has no direction
_STRAIGHT = 1e-6  # |u2 - u1| below which a waypoint needs no turn


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


class Waypoint(NamedTuple):
    """A point to reach, and how."""

    position: Vector3  # [m]
    tolerance: float  # [m] How far a turn may miss the point
    limits: MotionLimits  # On the way there


class Leg(NamedTuple):
    """The way to one waypoint: straight, then round it (no turn when it ends in a stop)."""

    straight: tuple[Piece, ...]
    turn: tuple[Piece, ...]
    exit_speed: float  # [m/s]


class _Turn(NamedTuple):
    length: float  # [m] v T: half of it is cut off either leg
    speed: float  # [m/s]


def add(left: Vector3, right: Vector3) -> Vector3:
    """Sum of two vectors."""
    return (left[0] + right[0], left[1] + right[1], left[2] + right[2])


def subtract(left: Vector3, right: Vector3) -> Vector3:
    """Difference of two vectors."""
    return (left[0] - right[0], left[1] - right[1], left[2] - right[2])


def scale(vector: Vector3, factor: float) -> Vector3:
    """Vector times number."""
    return (vector[0] * factor, vector[1] * factor, vector[2] * factor)


def norm(vector: Vector3) -> float:
    """Length of a vector."""
    return math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)


def along(direction: Vector3, limits: MotionLimits) -> Limits:
    """Limits of motion along a unit vector."""
    horizontal = math.hypot(direction[0], direction[1])
    climbing = direction[2] < 0.0
    vertical = abs(direction[2])

    def least(flat: float, upright: float) -> float:
        return min(
            flat / horizontal if horizontal > _STRAIGHT else math.inf,
            upright / vertical if vertical > _STRAIGHT else math.inf,
        )

    # A leg is both accelerated and braked, so the weaker vertical acceleration counts.
    acceleration = min(limits.acceleration_up, limits.acceleration_down)
    return Limits(
        least(limits.speed_horizontal, limits.speed_up if climbing else limits.speed_down),
        least(limits.acceleration_horizontal, acceleration),
        limits.jerk,
    )


def _direction(start: Vector3, end: Vector3) -> tuple[Vector3, float]:
    """Unit vector and distance [m] from start to end; zero vector when they coincide."""
    difference = subtract(end, start)
    distance = norm(difference)
    if distance < _SHORTEST_LEG_M:
        return ZERO, 0.0
    return scale(difference, 1.0 / distance), distance


def _turn(before: Vector3, after: Vector3, room: float, waypoint: Waypoint) -> _Turn:
    """Fastest turn from unit vector `before` to `after` that cuts at most `room` [m] off each."""
    change = subtract(after, before)
    size = norm(change)
    if size < _STRAIGHT:
        return _Turn(0.0, math.inf)
    length = min(2.0 * room, 32.0 * waypoint.tolerance / (3.0 * size))
    bend = along(scale(change, 1.0 / size), waypoint.limits)
    by_acceleration = math.sqrt(bend.acceleration * length / (1.5 * size))
    by_jerk = (bend.jerk * length * length / (6.0 * size)) ** (1.0 / 3.0)
    return _Turn(length, min(by_acceleration, by_jerk))


def _turn_piece(corner: Vector3, before: Vector3, after: Vector3, turn: _Turn) -> Piece:
    duration = turn.length / turn.speed
    change = scale(subtract(after, before), turn.speed)
    return Piece(
        duration,
        subtract(corner, scale(before, 0.5 * turn.length)),
        scale(before, turn.speed),
        ZERO,
        scale(change, 6.0 / duration**2),
        scale(change, -12.0 / duration**3),
    )


def straight_pieces(
    start: Vector3, direction: Vector3, speed: float, acceleration: float, phases: Sequence[Phase]
) -> tuple[Piece, ...]:
    """Pieces of a speed profile that begins at `start` with `speed` and `acceleration`."""
    pieces: list[Piece] = []
    state = MotionState(start, scale(direction, speed), scale(direction, acceleration))
    for phase in phases:
        piece = Piece(phase.duration, *state, scale(direction, phase.jerk), ZERO)
        pieces.append(piece)
        state = piece.end()
    return tuple(pieces)


def plan_leg(
    start: Vector3, speed: float, waypoints: Sequence[Waypoint], acceleration: float = 0.0
) -> Leg | None:
    """Plan the way to the first of `waypoints`, heading on to the others; the last is a stop.

    Args:
        start: present position [m], on the line to the first waypoint when moving.
        speed: present speed towards it [m/s].
        waypoints: at least one; those after the first only shape the turns.
        acceleration: present acceleration towards it [m/s^2].

    Returns:
        The leg, or None when the speed is too high to make the turn or the stop.
    """
    directions, distances = _geometry(start, waypoints)
    turns = _turns(directions, distances, waypoints)
    exit_speed = _exit_speed(directions, distances, turns, waypoints)
    direction, distance = directions[0], distances[0]
    if distance == 0.0:
        return Leg((), (), 0.0) if speed <= 0.0 or len(waypoints) == 1 else None
    turn = turns[0]._replace(speed=exit_speed)
    limits = along(direction, waypoints[0].limits)
    released = speed_profile.release(acceleration, limits)
    lead = straight_pieces(start, direction, speed, acceleration, released)
    position, velocity, _ = lead[-1].end() if lead else MotionState(start, ZERO, ZERO)
    speed = _dot(velocity, direction) if lead else speed
    room = distance - 0.5 * turn.length - norm(subtract(position, start))
    phases = speed_profile.plan(room, speed, exit_speed, limits) if min(speed, room) >= 0 else None
    if phases is None:
        return None
    straight = lead + straight_pieces(position, direction, speed, 0.0, phases)
    if turn.length > 0.0 and exit_speed > 0.0:
        corner = _turn_piece(waypoints[0].position, direction, directions[1], turn)
        return Leg(straight, (corner,), exit_speed)
    return Leg(straight, (), exit_speed)


def _dot(left: Vector3, right: Vector3) -> float:
    return left[0] * right[0] + left[1] * right[1] + left[2] * right[2]


def _geometry(start: Vector3, waypoints: Sequence[Waypoint]) -> tuple[list[Vector3], list[float]]:
    directions: list[Vector3] = []
    distances: list[float] = []
    for waypoint in waypoints:
        direction, distance = _direction(start, waypoint.position)
        directions.append(direction)
        distances.append(distance)
        start = waypoint.position
    return directions, distances


def _turns(
    directions: Sequence[Vector3], distances: Sequence[float], waypoints: Sequence[Waypoint]
) -> list[_Turn]:
    """Turn at each waypoint; a stop at the last, and where two coincide."""
    turns: list[_Turn] = []
    for index in range(len(waypoints) - 1):
        if distances[index] == 0.0 or distances[index + 1] == 0.0:
            turns.append(_Turn(0.0, 0.0))
            continue
        room = 0.45 * min(distances[index], distances[index + 1])
        turns.append(_turn(directions[index], directions[index + 1], room, waypoints[index]))
    turns.append(_Turn(0.0, 0.0))
    return turns


def _exit_speed(
    directions: Sequence[Vector3],
    distances: Sequence[float],
    turns: Sequence[_Turn],
    waypoints: Sequence[Waypoint],
) -> float:
    """Speed [m/s] past the first waypoint from which all later turns and the stop can be made."""
    speed = 0.0
    for index in range(len(waypoints) - 1, 0, -1):
        limits = along(directions[index], waypoints[index].limits)
        before = along(directions[index - 1], waypoints[index - 1].limits)
        room = distances[index] - 0.5 * (turns[index - 1].length + turns[index].length)
        reachable = speed_profile.highest_start(room, speed, limits) if room > 0.0 else 0.0
        speed = min(reachable, turns[index - 1].speed, before.speed, limits.speed)
    return speed


def stop_piece(state: MotionState, limits: MotionLimits) -> Piece | None:
    """Come to rest from any motion; None when already at rest."""
    _, velocity, acceleration = state
    speed, pull = norm(velocity), norm(acceleration)
    if speed < 1e-6 and pull < 1e-6:
        return None
    ceiling = min(limits.acceleration_horizontal, limits.acceleration_up, limits.acceleration_down)
    # Slope of the Hermite polynomials: at most 3/2 and 1; curvature: at most 6 and 4.
    duration = max(
        1.5 * speed / ceiling,
        (4.0 * pull + math.sqrt(16.0 * pull * pull + 24.0 * limits.jerk * speed))
        / (2.0 * limits.jerk),
    )
    return Piece(
        duration,
        *state,
        add(scale(velocity, -6.0 / duration**2), scale(acceleration, -4.0 / duration)),
        add(scale(velocity, 12.0 / duration**3), scale(acceleration, 6.0 / duration**2)),
    )
