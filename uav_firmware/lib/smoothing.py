"""Flyable motion through waypoints: continuous position, velocity and acceleration.

Three kinds of `motion.Piece` are enough:

* along a straight leg, the double-S profile of `speed_profile`;
* round a waypoint, the velocity turns from v u1 to v u2 by the blend s(x) = 3 x^2 - 2 x^3
  within a time T. It begins and ends v T / 2 from the waypoint, without acceleration, and
  misses the waypoint by 3/32 v T |u2 - u1| at its middle. Acceleration is at most
  3/2 v |u2 - u1| / T and jerk at most 6 v |u2 - u1| / T^2, which gives v in closed form;
* from any motion to rest, `motion.stop_pieces`, or into a leg, `motion.bend_piece`.

Frames: NED, SI.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from uav_firmware.lib import speed_profile
from uav_firmware.lib.motion import (
    MotionLimits,
    MotionState,
    Piece,
    along,
    bend_piece,
    stop_pieces,
    straight_pieces,
)
from uav_firmware.lib.vector import ZERO, dot, norm, scale, subtract
from uav_firmware.msg.vectors import Vector3

_SHORTEST_LEG_M = 1e-3  # below it a leg has no direction
_STRAIGHT = 1e-6  # |u2 - u1| below which a waypoint needs no turn
_SHARE_OF_LEG = 0.45  # of a leg that the turn at either end may cut off
_SLOWEST_TURN = 0.1  # [m/s] a slower turn is flown as a stop
_JOINING_SHARES = (1.0, 0.7, 0.45)  # of a leg's speed limit, tried as the speed to join it at
_AIMINGS = 6  # corrections of the direction in which a leg is joined
_AIMED = 1e-6  # change of that direction at which it is found
_BEND_SAMPLES = 8  # moments at which a bend is held to its limits
_SLACK = 1.001


class Waypoint(NamedTuple):
    """A point to reach, and how."""

    position: Vector3  # [m]
    tolerance: float  # [m] How far a turn may miss the point; 0 is a stop
    limits: MotionLimits  # On the leg


class Leg(NamedTuple):
    """The leg to one waypoint: straight, then round it (no turn when it ends in a stop)."""

    straight: tuple[Piece, ...]
    turn: tuple[Piece, ...]
    exit_speed: float  # [m/s]


class _Turn(NamedTuple):
    length: float  # [m] v T: half of it is cut off either leg
    speed: float  # [m/s]


_STOP = _Turn(0.0, 0.0)


class _Course(NamedTuple):
    """Geometry of the path through the waypoints."""

    directions: list[Vector3]  # [-] Unit vectors to each waypoint
    distances: list[float]  # [m] Whole lengths of the legs
    turns: list[_Turn]


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


def plan_leg(
    start: Vector3,
    speed: float,
    waypoints: Sequence[Waypoint],
    *,
    acceleration: float = 0.0,
    origin: Vector3 | None = None,
) -> Leg | None:
    """Plan the path to the first of `waypoints`, heading on to the others; the last is a stop.

    Args:
        start: present position [m], on the line to the first waypoint when moving.
        speed: present speed towards it [m/s].
        waypoints: at least one; those after the first only shape the turns.
        acceleration: present acceleration towards it [m/s^2].
        origin: where the line to the first waypoint began [m]; `start` when None.

    Returns:
        The leg, or None when the speed is too high to make the turn or the stop.
    """
    course = _course(start, start if origin is None else origin, waypoints)
    direction, distance = course.directions[0], norm(subtract(waypoints[0].position, start))
    if distance < _SHORTEST_LEG_M:
        return Leg((), (), 0.0) if speed <= 0.0 else None
    limits = along(direction, waypoints[0].limits)
    moving = MotionState(start, scale(direction, speed), scale(direction, acceleration))
    lead = straight_pieces(moving, direction, speed_profile.release(acceleration, limits))
    freed = lead[-1].end() if lead else moving
    freed_speed = dot(freed.velocity, direction)
    room = dot(subtract(waypoints[0].position, freed.position), direction)
    turn = _first_turn(course, waypoints, room, freed_speed)
    if freed_speed < 0.0 or turn is None:
        return None
    phases = speed_profile.plan(room - 0.5 * turn.length, freed_speed, turn.speed, limits)
    if phases is None:
        return None
    coasting = freed._replace(acceleration=ZERO)
    straight = lead + straight_pieces(coasting, direction, phases)
    if turn.length == 0.0:
        return Leg(straight, (), turn.speed)
    corner = _turn_piece(waypoints[0].position, direction, course.directions[1], turn)
    return Leg(straight, (corner,), turn.speed)


def join(state: MotionState, waypoints: Sequence[Waypoint]) -> tuple[Piece, Leg] | None:
    """Bend from any motion into the leg to the first of `waypoints`, without a stop between.

    Returns:
        The bend and the leg from its end, the quickest of a few; None when coming to rest
        first is as quick, or no bend keeps to the limits.
    """
    stop = stop_pieces(state, waypoints[0].limits)
    if not stop:
        return None
    from_rest = plan_leg(stop[-1].end().position, 0.0, waypoints)
    best: tuple[Piece, Leg] | None = None
    shortest = math.inf
    if from_rest is not None:
        shortest = sum(piece.duration for piece in stop) + _duration(from_rest)
    for share in _JOINING_SHARES:
        bend = _bend_towards(state, waypoints[0], share)
        if bend is None:
            continue
        end = bend.end()
        leg = plan_leg(end.position, norm(end.velocity), waypoints)
        if leg is not None and bend.duration + _duration(leg) < shortest:
            best, shortest = (bend, leg), bend.duration + _duration(leg)
    return best


def _duration(leg: Leg) -> float:
    return sum((piece.duration for piece in (*leg.straight, *leg.turn)), 0.0)


def _bend_towards(state: MotionState, waypoint: Waypoint, share: float) -> Piece | None:
    """Bend whose end heads straight for a waypoint, at a share of the speed allowed."""
    direction, distance = _direction(state.position, waypoint.position)
    for _ in range(_AIMINGS):
        if distance == 0.0:
            return None
        speed = share * along(direction, waypoint.limits).speed
        bend = bend_piece(state, scale(direction, speed), waypoint.limits)
        before = direction
        direction, distance = _direction(bend.end().position, waypoint.position)
        if norm(subtract(direction, before)) < _AIMED:
            return bend if _keeps_to(bend, waypoint.limits) else None
    return None


def _keeps_to(bend: Piece, limits: MotionLimits) -> bool:
    """Whether a bend stays within speeds and accelerations, or within those that it begins at."""
    top, fastest = math.hypot(*bend.velocity[:2]), norm(bend.velocity)
    climb, sink = max(0.0, -bend.velocity[2]), max(0.0, bend.velocity[2])
    for index in range(1, _BEND_SAMPLES + 1):
        _, velocity, acceleration = bend.at(bend.duration * index / _BEND_SAMPLES)
        if not (
            math.hypot(*velocity[:2]) <= _SLACK * max(limits.speed_horizontal, top)
            and norm(velocity) <= _SLACK * max(limits.speed_path, fastest)
            and -velocity[2] <= _SLACK * max(limits.speed_up, climb)
            and velocity[2] <= _SLACK * max(limits.speed_down, sink)
            and math.hypot(*acceleration[:2]) <= _SLACK * limits.acceleration_horizontal
        ):
            return False
    return True


def _first_turn(
    course: _Course, waypoints: Sequence[Waypoint], room: float, speed: float
) -> _Turn | None:
    """Turn at the first waypoint at the speed that can be reached and is safe; None if none."""
    limits = along(course.directions[0], waypoints[0].limits)
    turn = course.turns[0]
    room -= 0.5 * turn.length
    if room < 0.0:
        return None
    wanted = _exit_speed(course, waypoints)
    reachable = speed_profile.highest_start(room, speed, limits)
    wanted = min(wanted, reachable)
    return turn._replace(speed=wanted) if wanted > _SLOWEST_TURN else _STOP


def _course(start: Vector3, origin: Vector3, waypoints: Sequence[Waypoint]) -> _Course:
    directions: list[Vector3] = []
    distances: list[float] = []
    for index, waypoint in enumerate(waypoints):
        before = start if index == 0 else waypoints[index - 1].position
        direction, distance = _direction(before, waypoint.position)
        directions.append(direction)
        distances.append(distance)
    if distances[0] > 0.0:
        distances[0] = max(distances[0], norm(subtract(waypoints[0].position, origin)))
    return _Course(directions, distances, _turns(directions, distances, waypoints))


def _turns(
    directions: Sequence[Vector3], distances: Sequence[float], waypoints: Sequence[Waypoint]
) -> list[_Turn]:
    """Turn at each waypoint; a stop at the last, and where two coincide."""
    turns: list[_Turn] = []
    for index in range(len(waypoints) - 1):
        room = _SHARE_OF_LEG * min(distances[index], distances[index + 1])
        if room == 0.0 or waypoints[index].tolerance <= 0.0:
            turns.append(_STOP)
        else:
            turns.append(_turn(directions[index], directions[index + 1], room, waypoints[index]))
    turns.append(_STOP)
    return turns


def _exit_speed(course: _Course, waypoints: Sequence[Waypoint]) -> float:
    """Speed [m/s] past the first waypoint from which all later turns and the stop can be made."""
    directions, distances, turns = course
    speed = 0.0
    for index in range(len(waypoints) - 1, 0, -1):
        limits = along(directions[index], waypoints[index].limits)
        before = along(directions[index - 1], waypoints[index - 1].limits)
        room = distances[index] - 0.5 * (turns[index - 1].length + turns[index].length)
        reachable = speed_profile.highest_start(room, speed, limits) if room > 0.0 else 0.0
        speed = min(reachable, turns[index - 1].speed, before.speed, limits.speed)
    return speed
