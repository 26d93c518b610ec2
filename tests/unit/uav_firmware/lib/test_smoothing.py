"""Motion through waypoints keeps its limits, arrives, and passes where it should."""

import itertools
import math
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uav_firmware.lib.motion import MotionLimits, MotionState, Piece, stop_pieces
from uav_firmware.lib.smoothing import Waypoint, plan_leg
from uav_firmware.lib.vector import ZERO, norm, subtract
from uav_firmware.msg.vectors import Vector3

LIMITS = MotionLimits(5.0, 3.0, 1.5, 3.0, 4.0, 3.0, 8.0)
SLACK = 1.0 + 1e-6
AT_REST = 1e-5
"""A slower motion is not braked at all; in m/s and m/s²."""

coordinate = st.floats(-60.0, 60.0)
points = st.tuples(coordinate, coordinate, st.floats(-60.0, 0.0))
limit_sets = st.builds(
    MotionLimits,
    st.floats(0.5, 12.0),
    st.floats(0.5, 5.0),
    st.floats(0.5, 3.0),
    st.floats(1.0, 5.0),
    st.floats(1.0, 5.0),
    st.floats(1.0, 5.0),
    st.floats(2.0, 20.0),
    st.floats(0.5, 12.0) | st.just(math.inf),
    st.floats(0.5, 20.0) | st.just(math.inf),
)


def route_pieces(start: Vector3, waypoints: list[Waypoint]) -> Iterator[tuple[int, Piece]]:
    """All pieces to the end of a route, planned leg by leg as in flight."""
    position, origin, speed = start, start, 0.0
    for index in range(len(waypoints)):
        leg = plan_leg(position, speed, waypoints[index : index + 8], origin=origin)
        assert leg is not None
        for piece in (*leg.straight, *leg.turn):
            yield index, piece
            position = piece.end().position
        speed, origin = leg.exit_speed, waypoints[index].position


def samples(piece: Piece, count: int = 20) -> list[MotionState]:
    return [piece.at(piece.duration * k / count) for k in range(count + 1)]


def assert_within(state: MotionState, limits: MotionLimits) -> None:
    north, east, down = state.velocity
    assert math.hypot(north, east) <= limits.speed_horizontal * SLACK + 1e-6
    assert norm(state.velocity) <= limits.speed_path * SLACK + 1e-6
    assert -limits.speed_up * SLACK - 1e-6 <= down <= limits.speed_down * SLACK + 1e-6
    north, east, down = state.acceleration
    assert math.hypot(north, east) <= limits.acceleration_horizontal * SLACK + 1e-6
    assert abs(down) <= max(limits.acceleration_up, limits.acceleration_down) * SLACK + 1e-6


routes = st.tuples(points, st.lists(st.tuples(points, st.floats(0.0, 3.0)), min_size=1, max_size=6))


@settings(deadline=None, max_examples=150)
@given(routes, limit_sets)
def test_motion_arrives_within_its_limits_and_without_a_jump(
    route: tuple[Vector3, list[tuple[Vector3, float]]], limits: MotionLimits
) -> None:
    start, targets = route
    waypoints = [Waypoint(point, tolerance, limits) for point, tolerance in targets]
    state = MotionState(start, ZERO, ZERO)
    for _, piece in route_pieces(start, waypoints):
        first = piece.at(0.0)
        assert norm(subtract(first.position, state.position)) < 1e-4
        assert norm(subtract(first.velocity, state.velocity)) < 1e-4
        assert norm(subtract(first.acceleration, state.acceleration)) < 1e-4
        for state in samples(piece):
            assert_within(state, limits)
        jerk_at_end = tuple(
            j + k * piece.duration for j, k in zip(piece.jerk, piece.snap, strict=True)
        )
        assert norm(piece.jerk) <= limits.jerk * SLACK
        assert norm(jerk_at_end) <= limits.jerk * SLACK  # type: ignore[arg-type]  # three floats
        state = piece.end()
    assert norm(subtract(state.position, targets[-1][0])) < 2e-3
    assert norm(state.velocity) < 1e-6


@settings(deadline=None, max_examples=100)
@given(routes)
def test_every_waypoint_is_passed_within_its_tolerance(
    route: tuple[Vector3, list[tuple[Vector3, float]]],
) -> None:
    start, targets = route
    waypoints = [Waypoint(point, tolerance, LIMITS) for point, tolerance in targets]
    nearest = [norm(subtract(start, point)) for point, _ in targets]
    for _, piece in route_pieces(start, waypoints):
        for state in samples(piece, 40):
            for index, (point, _) in enumerate(targets):
                nearest[index] = min(nearest[index], norm(subtract(state.position, point)))
    for distance, (_, tolerance) in zip(nearest, targets, strict=True):
        assert distance <= tolerance + 0.02


@given(points, points, limit_sets)
def test_a_stop_is_not_overshot(start: Vector3, end: Vector3, limits: MotionLimits) -> None:
    way = norm(subtract(end, start))
    for _, piece in route_pieces(start, [Waypoint(end, 0.0, limits)]):
        for state in samples(piece):
            assert norm(subtract(state.position, start)) <= way + 0.01


motions = st.tuples(
    st.tuples(*[st.floats(-12.0, 12.0)] * 3), st.tuples(*[st.floats(-2.0, 2.0)] * 3)
)


@given(motions)
def test_braking_ends_at_rest_within_acceleration_and_jerk(
    motion: tuple[Vector3, Vector3],
) -> None:
    velocity, acceleration = motion
    pieces = stop_pieces(MotionState(ZERO, velocity, acceleration), LIMITS)
    if not pieces:
        assert norm(velocity) < AT_REST
        return
    # A present acceleration goes on until the jerk has taken it away.
    rise = norm(acceleration) ** 2 / LIMITS.jerk
    for before, after in itertools.pairwise(pieces):
        assert before.end().velocity == pytest.approx(after.velocity, abs=1e-9)
        assert before.end().acceleration == pytest.approx(after.acceleration, abs=1e-9)
    for piece in pieces:
        for state in samples(piece):
            level, upright = math.hypot(*state.acceleration[:2]), abs(state.acceleration[2])
            assert level <= max(3.0, math.hypot(*acceleration[:2])) * SLACK
            assert upright <= max(4.0, abs(acceleration[2])) * SLACK
            assert norm(state.velocity) <= norm(velocity) + rise + 1e-6
        assert norm(piece.jerk) <= LIMITS.jerk * SLACK
    end = pieces[-1].end()
    assert norm(end.velocity) < AT_REST
    assert norm(end.acceleration) < AT_REST


@given(motions)
def test_a_vertical_stop_brakes_with_what_acts_against_it(
    motion: tuple[Vector3, Vector3],
) -> None:
    climb = abs(motion[0][2])
    for pieces, limit in (
        (stop_pieces(MotionState(ZERO, (0.0, 0.0, -climb), ZERO), LIMITS), 3.0),
        (stop_pieces(MotionState(ZERO, (0.0, 0.0, climb), ZERO), LIMITS), 4.0),
    ):
        for piece in pieces:
            assert all(abs(state.acceleration[2]) <= limit * SLACK for state in samples(piece))
        if climb > 3.0:
            way = abs(pieces[-1].end().position[2])
            assert way == pytest.approx(climb**2 / (2.0 * limit) + climb * limit / 16.0, rel=1e-6)


@given(st.floats(0.0, 1.0), limit_sets)
def test_a_stop_during_a_leg_ends_no_later_than_the_leg(share: float, limits: MotionLimits) -> None:
    pieces = [piece for _, piece in route_pieces(ZERO, [Waypoint((40.0, 0.0, 0.0), 0.0, limits)])]
    time = share * sum(piece.duration for piece in pieces)
    for piece in pieces:
        if time <= piece.duration:
            stop = stop_pieces(piece.at(time), limits)
            assert not stop or stop[-1].end().position[0] <= 40.0 + 1e-3
            return
        time -= piece.duration


def duration_of(start: Vector3, waypoints: list[Waypoint]) -> float:
    return sum(piece.duration for _, piece in route_pieces(start, waypoints))


def test_flying_through_a_square_is_faster_than_stopping_at_its_corners() -> None:
    corners: list[Vector3] = [(20.0, 0.0, -5.0), (20.0, 20.0, -5.0), (0.0, 20.0, -5.0)]
    through = [Waypoint(corner, 1.0, LIMITS) for corner in corners]
    stops = [Waypoint(corner, 0.0, LIMITS) for corner in corners]
    start = (0.0, 0.0, -5.0)
    assert duration_of(start, through) < duration_of(start, stops) - 1.0


def test_a_larger_tolerance_is_not_slower() -> None:
    corner, end = (20.0, 0.0, -5.0), (20.0, 20.0, -5.0)
    times = [
        duration_of(ZERO, [Waypoint(corner, tolerance, LIMITS), Waypoint(end, 0.0, LIMITS)])
        for tolerance in (0.1, 0.3, 1.0, 3.0)
    ]
    assert times == sorted(times, reverse=True)


def test_points_on_a_line_are_passed_at_full_speed() -> None:
    waypoints = [Waypoint((20.0 * k, 0.0, -5.0), 0.3, LIMITS) for k in range(1, 6)]
    pieces = list(route_pieces((0.0, 0.0, -5.0), waypoints))
    passing = [piece.at(0.0).velocity[0] for index, piece in pieces if index in {1, 2, 3}]
    assert passing == pytest.approx([LIMITS.speed_horizontal] * len(passing))


def test_too_short_a_way_to_stop_is_told_apart() -> None:
    assert plan_leg(ZERO, 5.0, [Waypoint((1.0, 0.0, 0.0), 0.0, LIMITS)]) is None


@given(st.floats(0.0, 4.0), st.floats(-2.0, 2.0))
def test_a_moving_start_joins_on(speed: float, acceleration: float) -> None:
    waypoint = Waypoint((100.0, 0.0, 0.0), 0.0, LIMITS)
    leg = plan_leg(ZERO, speed, [waypoint], acceleration=acceleration)
    if leg is None:
        assert speed + math.copysign(acceleration**2, acceleration) / (2 * LIMITS.jerk) < 1e-3
        return
    first = leg.straight[0].at(0.0)
    assert first.velocity[0] == pytest.approx(speed, abs=1e-9)
    assert first.acceleration[0] == pytest.approx(acceleration, abs=1e-5)
    assert norm(subtract(leg.straight[-1].end().position, waypoint.position)) < 1e-4
