"""The setpoint's motion along routes that change while it moves."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uav_firmware.lib.motion import MotionLimits
from uav_firmware.lib.smoothing import Waypoint
from uav_firmware.lib.speed_profile import Limits
from uav_firmware.lib.vector import norm, subtract
from uav_firmware.modules.navigator.path_follower import PathFollower
from uav_firmware.msg.vectors import Vector3

FAST = MotionLimits(5.0, 2.5, 1.5, 3.0, 4.0, 3.0, 8.0)
SLOW = FAST._replace(speed_horizontal=2.0, speed_up=1.0, speed_down=0.8)
DT = 0.02

coordinate = st.floats(-40.0, 40.0)
points = st.tuples(coordinate, coordinate, st.floats(-40.0, -2.0))
orders = st.lists(
    st.tuples(
        st.sampled_from(["fly", "stop", "slow", "fast"]),
        st.lists(st.tuples(points, st.floats(0.0, 2.0)), min_size=1, max_size=4),
        st.integers(1, 300),
    ),
    min_size=1,
    max_size=5,
)


def advance(path: PathFollower, steps: int) -> None:
    for _ in range(steps):
        before = path.state
        path.advance(DT)
        moved = norm(subtract(path.state.position, before.position))
        assert moved <= 8.0 * DT + 1e-3
        assert norm(subtract(path.state.velocity, before.velocity)) <= 5.0 * 1.5 * DT + 1e-3
        assert norm(path.state.acceleration) <= 5.0 * 1.2


@pytest.mark.thorough
@settings(deadline=None, max_examples=60)
@given(orders)
def test_orders_at_any_moment_never_make_the_setpoint_jump(
    given_orders: list[tuple[str, list[tuple[Vector3, float]], int]],
) -> None:
    path = PathFollower()
    goal: Vector3 | None = None
    for order, targets, steps in given_orders:
        if order == "fly":
            path.fly([Waypoint(point, radius, FAST) for point, radius in targets], FAST)
            goal = targets[-1][0]
        elif order == "stop":
            path.stop(FAST)
            goal = None
        else:
            path.relimit(SLOW if order == "slow" else FAST)
        advance(path, steps)
    advance(path, 12_000)
    assert path.resting
    if goal is not None:
        assert norm(subtract(path.state.position, goal)) < 0.01


def test_a_lower_speed_applies_during_a_leg() -> None:
    path = PathFollower()
    path.fly([Waypoint((200.0, 0.0, 0.0), 0.0, FAST)], FAST)
    advance(path, 200)
    path.relimit(SLOW)
    advance(path, 150)
    assert math.isclose(path.state.velocity[0], 2.0, abs_tol=1e-6)


def test_waypoints_are_counted_as_they_are_passed() -> None:
    path = PathFollower()
    path.fly([Waypoint((10.0, 0.0, 0.0), 0.5, FAST), Waypoint((10.0, 10.0, 0.0), 0.0, FAST)], FAST)
    seen = []
    while not path.resting:
        path.advance(DT)
        seen.append(path.passed)
    assert sorted(set(seen)) == [0, 1, 2]
    assert seen == sorted(seen)


def test_sinking_goes_on_for_ever_at_its_speed() -> None:
    path = PathFollower()
    path.reset((0.0, 0.0, -20.0))
    path.descend(15.0, 0.7, FAST)
    fastest = 0.0
    while not path.sinking:
        path.advance(DT)
        fastest = max(fastest, path.state.velocity[2])
    assert math.isclose(path.state.position[2], -5.0, abs_tol=0.1)
    assert math.isclose(fastest, 1.5, abs_tol=1e-6)
    advance(path, 3000)
    assert path.sinking
    assert math.isclose(path.state.velocity[2], 0.7, abs_tol=1e-9)


def time_to_rest(path: PathFollower, goal: Vector3) -> float:
    steps = 0
    while not path.resting:
        advance(path, 1)
        steps += 1
    assert norm(subtract(path.state.position, goal)) < 0.01
    return steps * DT


def test_a_new_order_in_flight_bends_instead_of_stopping() -> None:
    goal = (40.0, 25.0, 0.0)
    times = []
    for stopping in (False, True):
        path = PathFollower()
        path.fly([Waypoint((60.0, 0.0, 0.0), 0.0, FAST)], FAST)
        advance(path, 150)
        waited = 0.0
        if stopping:
            path.stop(FAST)
            waited = time_to_rest(path, path.rest_point(FAST))
        path.fly([Waypoint(goal, 0.0, FAST)], FAST)
        times.append(waited + time_to_rest(path, goal))
    assert times[0] < times[1] - 1.0


def test_an_order_straight_ahead_keeps_the_speed() -> None:
    path = PathFollower()
    path.fly([Waypoint((60.0, 0.0, 0.0), 0.0, FAST)], FAST)
    advance(path, 150)
    path.fly([Waypoint((90.0, 0.0, 0.0), 0.0, FAST)], FAST)
    for _ in range(100):
        advance(path, 1)
        assert path.state.velocity[0] > 4.9


def test_limits_that_change_in_a_bend_are_taken_up() -> None:
    path = PathFollower()
    path.fly([Waypoint((60.0, 0.0, 0.0), 0.0, FAST)], FAST)
    advance(path, 150)
    path.fly([Waypoint((30.0, 60.0, 0.0), 0.0, FAST)], FAST)
    advance(path, 5)
    path.relimit(SLOW)
    advance(path, 250)
    assert norm(path.state.velocity) <= 2.0 + 1e-6
    time_to_rest(path, (30.0, 60.0, 0.0))


def test_the_goal_is_the_next_waypoint_until_the_route_is_over() -> None:
    path = PathFollower()
    path.reset((0.0, 0.0, -10.0))
    assert path.goal is None
    route = [Waypoint((20.0, 0.0, -10.0), 0.0, FAST), Waypoint((20.0, 20.0, -10.0), 0.0, FAST)]
    path.fly(route, FAST)
    goals: list[Vector3 | None] = []
    for _ in range(3000):
        if path.goal not in goals:
            goals.append(path.goal)
        path.advance(DT)
    assert goals == [route[0].position, route[1].position, None]


def test_a_stop_goes_no_further_than_a_vehicle_that_brakes_harder() -> None:
    path = PathFollower()
    path.reset((0.0, 0.0, 0.0), (0.0, 0.0, -9.0))
    path.stop(FAST)
    planned = path.rest_point(FAST)[2]
    down, speed = 0.0, -9.0
    while path.stopping:
        speed = min(0.0, speed + 7.0 * DT)
        down += speed * DT
        path.shorten_stop((0.0, 0.0, down), (0.0, 0.0, speed))
        before = path.state
        path.advance(DT)
        assert path.state.velocity[2] >= before.velocity[2] - 1e-9
    assert planned < -13.0
    assert down - 0.2 < path.state.position[2] < down + 0.5


def test_a_stop_is_as_planned_for_a_vehicle_that_follows() -> None:
    path = PathFollower()
    path.reset((0.0, 0.0, 0.0), (5.0, 3.0, -1.0))
    path.stop(FAST)
    planned = path.rest_point(FAST)
    while path.stopping:
        state = path.state
        path.shorten_stop(state.position, state.velocity)
        path.advance(DT)
    assert path.state.position == pytest.approx(planned, abs=1e-6)


def test_a_stop_on_a_circle_keeps_to_it() -> None:
    path = PathFollower()
    path.reset((20.0, 0.0, -10.0))
    path.circle((0.0, 0.0, -10.0), -20.0, math.inf, Limits(4.0, 1.0, 2.0))
    advance(path, 600)
    path.stop(FAST)
    points = path.stop_points(FAST)
    while not path.resting:
        advance(path, 1)
        assert math.isclose(math.hypot(*path.state.position[:2]), 20.0, abs_tol=1e-6)
    assert path.state.position == pytest.approx(points[-1], abs=1e-6)
