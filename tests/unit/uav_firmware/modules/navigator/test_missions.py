"""Missions flown by a kinematic vehicle through navigator and commander."""

import math
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.toy_vehicle import HOME, ToyVehicle, at, item, takeoff, waypoint
from uav_firmware.msg.mission import MissionItem, MissionState
from uav_firmware.msg.status import Command, NavigationState
from uav_firmware.msg.vectors import Vector3

ACCEPTED = 0
MISSION_MODE = 4


def ready(lag_s: float = 0.15) -> ToyVehicle:
    vehicle = ToyVehicle(lag_s=lag_s)
    vehicle.run(0.5)
    return vehicle


def start(vehicle: ToyVehicle, *items: MissionItem) -> ToyVehicle:
    vehicle.upload(*items)
    vehicle.run(0.1)
    assert vehicle.send(Command.MISSION_START) == ACCEPTED
    assert vehicle.arm() == ACCEPTED
    return vehicle


def square() -> tuple[MissionItem, ...]:
    return (
        takeoff(),
        waypoint(1, 20, 0),
        waypoint(2, 20, 20),
        waypoint(3, 0, 20, param1=2.0),
        item(4, 20),
    )


def nearest(vehicle: ToyVehicle, point: Vector3) -> float:
    return min(math.dist(position, point) for position in vehicle.track)


def completed(vehicle: ToyVehicle) -> bool:
    return vehicle.state == MissionState.COMPLETE


@pytest.mark.first_case
@pytest.mark.parametrize("lag_s", [0.0, 0.3])
def test_a_square_passes_every_waypoint_and_ends_disarmed_at_home(lag_s: float) -> None:
    vehicle = start(ready(lag_s), *square())
    vehicle.run_until(lambda v: not v.armed)
    assert vehicle.reached == [0, 1, 2, 3, 4]
    assert vehicle.state == MissionState.COMPLETE
    assert vehicle.mode is NavigationState.AUTO_LOITER
    assert math.hypot(*vehicle.position[:2]) < 0.3
    for north, east in ((20, 0), (20, 20), (0, 20)):
        assert nearest(vehicle, (north, east, -5.0)) < 0.5


@pytest.mark.first_case
@pytest.mark.parametrize("arm_first", [True, False])
def test_arming_before_and_after_the_start_both_fly(arm_first: bool) -> None:
    vehicle = ready()
    vehicle.upload(*square())
    vehicle.run(0.1)
    if arm_first:
        assert vehicle.arm() == ACCEPTED
    assert vehicle.set_mode(MISSION_MODE) == ACCEPTED
    if not arm_first:
        assert vehicle.arm() == ACCEPTED
    vehicle.run_until(lambda v: len(v.reached) == 2, 30.0)


def test_the_take_off_climbs_before_it_goes_to_its_point() -> None:
    vehicle = start(ready(), takeoff(height=5.0, param4=90.0, **at(8, 6)), waypoint(1, 8, 20))
    vehicle.run_until(lambda v: bool(v.reached))
    low = [p for p in vehicle.track if -p[2] < 4.0]
    assert max(math.hypot(p[0], p[1]) for p in low) < 0.1
    assert nearest(vehicle, (8.0, 6.0, -5.0)) < 0.5
    assert vehicle.yaw == pytest.approx(math.pi / 2, abs=0.02)


def test_a_waypoint_is_held_for_its_time() -> None:
    vehicle = start(ready(), takeoff(), waypoint(1, 10, 0, param1=4.0), waypoint(2, 20, 0))
    vehicle.run_until(lambda v: math.dist(v.position, (10, 0, -5)) < 0.05)
    vehicle.run(3.5)
    assert math.dist(vehicle.position, (10, 0, -5)) < 0.1
    assert vehicle.reached == [0]
    vehicle.run_until(lambda v: v.reached == [0, 1], 2.0)


def test_a_waypoint_without_hold_is_passed_without_stopping() -> None:
    vehicle = start(ready(), takeoff(), waypoint(1, 20, 0), waypoint(2, 40, 20))
    vehicle.run_until(lambda v: v.reached == [0, 1])
    assert math.hypot(*vehicle.velocity[:2]) > 1.0


def test_the_nose_follows_the_path_unless_a_yaw_is_given() -> None:
    vehicle = start(ready(), takeoff(), waypoint(1, 0, 20), waypoint(2, 0, 40, param4=180.0))
    vehicle.run_until(lambda v: v.position[1] > 15.0)
    assert vehicle.yaw == pytest.approx(math.pi / 2, abs=0.05)
    vehicle.run_until(completed)
    assert abs(vehicle.yaw) == pytest.approx(math.pi, abs=0.02)


def test_a_pause_does_not_turn_the_nose() -> None:
    vehicle = start(ready(), takeoff(), waypoint(1, 0, 40), waypoint(2, 0, 60))
    vehicle.run_until(lambda v: v.position[1] > 20.0)
    vehicle.send(Command.DO_REPOSITION, -1.0, 1.0, 0.0, 1.2, math.nan, math.nan, math.nan)
    vehicle.run(5.0)
    vehicle.send(Command.DO_PAUSE_CONTINUE, 1.0)
    yaws = []
    while vehicle.position[1] < 38.0:
        vehicle.step()
        yaws.append(vehicle.yaw)
    assert min(yaws) > 1.19
    assert max(yaws) < math.pi / 2 + 0.01


def test_a_change_of_speed_holds_for_the_legs_after_it() -> None:
    vehicle = start(
        ready(),
        takeoff(),
        waypoint(1, 30, 0),
        item(2, 178, param1=1.0, param2=2.0, param3=-1.0),
        waypoint(3, 60, 0),
    )
    vehicle.run_until(lambda v: v.position[0] > 15.0)
    assert vehicle.velocity[0] == pytest.approx(5.0, abs=0.1)
    vehicle.run_until(lambda v: v.position[0] > 40.0)
    assert vehicle.velocity[0] == pytest.approx(2.0, abs=0.1)


def test_a_commanded_speed_takes_effect_at_once_and_lasts_through_a_pause() -> None:
    vehicle = start(ready(), takeoff(), waypoint(1, 100, 0))
    vehicle.run_until(lambda v: v.position[0] > 10.0)
    assert vehicle.send(Command.DO_CHANGE_SPEED, 1.0, 2.0, -1.0) == ACCEPTED
    vehicle.run(2.5)
    assert vehicle.velocity[0] == pytest.approx(2.0, abs=0.1)
    assert vehicle.send(Command.DO_PAUSE_CONTINUE, 0.0) == ACCEPTED
    vehicle.run(3.0)
    assert vehicle.send(Command.DO_PAUSE_CONTINUE, 1.0) == ACCEPTED
    vehicle.run(4.0)
    assert vehicle.velocity[0] == pytest.approx(2.0, abs=0.1)


def test_no_speed_beyond_the_limit_of_the_controller_is_commanded() -> None:
    vehicle = start(ready(), takeoff(), waypoint(1, 900, 0))
    assert vehicle.send(Command.DO_CHANGE_SPEED, 1.0, 1000.0, -1.0) == ACCEPTED
    vehicle.run_until(lambda v: v.position[0] > 400.0)
    assert vehicle.velocity[0] == pytest.approx(12.0, abs=0.1)


def test_pause_stops_and_continue_goes_on_at_the_same_item() -> None:
    vehicle = start(ready(), *square())
    vehicle.run_until(lambda v: v.position[0] > 10.0)
    assert vehicle.send(Command.DO_PAUSE_CONTINUE, 0.0) == ACCEPTED
    assert vehicle.state == MissionState.PAUSED
    vehicle.run(5.0)
    held = vehicle.position
    vehicle.run(5.0)
    assert math.dist(held, vehicle.position) < 0.05
    assert vehicle.send(Command.DO_PAUSE_CONTINUE, 1.0) == ACCEPTED
    vehicle.run_until(lambda v: not v.armed)
    assert vehicle.reached == [0, 1, 2, 3, 4]


def test_landing_at_a_point_goes_there_first() -> None:
    land = item(1, 21, **at(12, -9), z=0.0, param4=math.nan)
    vehicle = start(ready(), takeoff(height=10.0), land)
    vehicle.run_until(lambda v: not v.armed)
    assert vehicle.reached == [0, 1]
    assert math.dist(vehicle.position, (12, -9, 0)) < 0.3
    high = [p for p in vehicle.track if math.hypot(p[0] - 12, p[1] + 9) > 1.0 and p[0] > 1.0]
    assert min(-p[2] for p in high) > 9.0


def test_touch_down_is_slow() -> None:
    vehicle = start(ready(), takeoff(height=10.0), item(1, 21, param4=math.nan))
    vehicle.run_until(lambda v: len(v.reached) == 1)
    vehicle.run_until(lambda v: v.height < 0.3)
    assert 0.2 < vehicle.velocity[2] < 0.6


def test_a_mission_lands_takes_off_again_and_goes_on() -> None:
    vehicle = start(
        ready(),
        takeoff(),
        item(1, 21, **at(10, 0), param4=math.nan),
        item(2, 93, param1=5.0),
        takeoff(3),
        waypoint(4, 20, 0),
    )
    vehicle.run_until(completed)
    assert vehicle.reached == [0, 1, 2, 3, 4]
    assert vehicle.armed


def test_a_waypoint_from_the_ground_begins_with_a_climb() -> None:
    vehicle = start(ready(), waypoint(0, 20, 0), waypoint(1, 20, 20))
    vehicle.run_until(lambda v: v.reached == [0])
    assert max(p[0] for p in vehicle.track if -p[2] < 4.5) < 0.2


def test_an_unlimited_loiter_in_between_waits_for_a_command() -> None:
    vehicle = start(
        ready(), takeoff(), item(1, 17, **at(10, 0), z=5.0, param4=0.0), waypoint(2, 20, 0)
    )
    vehicle.run_until(lambda v: v.reached == [0, 1])
    vehicle.run(10.0)
    assert vehicle.position[0] == pytest.approx(10.0, abs=0.1)
    assert vehicle.send(Command.DO_PAUSE_CONTINUE, 0.0) == ACCEPTED
    assert vehicle.send(Command.DO_PAUSE_CONTINUE, 1.0) == ACCEPTED
    vehicle.run_until(completed, 30.0)


def test_a_jump_repeats_its_part() -> None:
    vehicle = start(
        ready(),
        takeoff(),
        waypoint(1, 5, 0),
        waypoint(2, 5, 5),
        item(3, 177, param1=1.0, param2=2.0),
    )
    vehicle.run_until(completed)
    assert vehicle.reached == [0, 1, 2, 1, 2, 1, 2]


@pytest.mark.first_case
@pytest.mark.parametrize("count", [2.0, -1.0])
def test_a_jump_is_flown_through_and_the_laps_keep_their_speed(count: float) -> None:
    square = ((30.0, 0.0), (30.0, 30.0), (0.0, 30.0), (0.0, 5.0))
    points = [waypoint(seq, *corner) for seq, corner in enumerate(square, 1)]
    vehicle = start(ready(), takeoff(), *points, item(5, 177, param1=1.0, param2=count))
    vehicle.run_until(lambda v: len(v.reached) == 2)
    slowest = math.inf
    while len(vehicle.reached) < 12:
        vehicle.run(0.02)
        slowest = min(slowest, math.hypot(vehicle.velocity[0], vehicle.velocity[1]))
    assert vehicle.reached == [0, *[1, 2, 3, 4] * 2, 1, 2, 3]
    assert slowest > 0.5


def test_a_finished_mission_begins_again_from_its_first_item() -> None:
    vehicle = start(ready(), takeoff(), waypoint(1, 10, 0), waypoint(2, 0, 10))
    vehicle.run_until(completed)
    vehicle.run(2.0)
    assert vehicle.send(Command.MISSION_START) == ACCEPTED
    assert vehicle.state == MissionState.ACTIVE
    vehicle.run_until(completed)
    assert vehicle.reached == [0, 1, 2, 0, 1, 2]


def test_a_new_mission_in_flight_is_flown_from_its_first_item() -> None:
    vehicle = start(ready(), *square())
    vehicle.run_until(lambda v: len(v.reached) == 2)
    vehicle.upload(waypoint(0, -10, 0), waypoint(1, -10, -10), mission_id=8)
    vehicle.run_until(completed)
    assert math.dist(vehicle.position, (-10, -10, -5)) < 0.5


def test_clearing_the_mission_in_flight_holds() -> None:
    vehicle = start(ready(), *square())
    vehicle.run_until(lambda v: len(v.reached) == 1)
    vehicle.upload(mission_id=0)
    vehicle.run(5.0)
    assert vehicle.state == MissionState.NO_MISSION
    assert vehicle.texts[-1] == "Mission cleared in flight: holding here"
    held = vehicle.position
    vehicle.run(5.0)
    assert math.dist(held, vehicle.position) < 0.05


def test_clearing_the_mission_on_the_ground_is_no_news() -> None:
    vehicle = ready()
    vehicle.upload(*square())
    vehicle.run(0.1)
    vehicle.upload(mission_id=0)
    vehicle.run(1.0)
    assert vehicle.texts == []


def test_another_item_can_be_chosen() -> None:
    vehicle = start(ready(), *square())
    vehicle.run_until(lambda v: len(v.reached) == 1)
    assert vehicle.send(Command.DO_SET_MISSION_CURRENT, 3.0) == ACCEPTED
    vehicle.run_until(lambda v: len(v.reached) == 2)
    assert vehicle.reached == [0, 3]


def test_a_vehicle_blown_past_a_waypoint_comes_back_to_it() -> None:
    vehicle = start(ready(0.05), takeoff(), waypoint(1, 40, 0), waypoint(2, 40, 40))
    vehicle.registry.set("MPC_XY_ERR_MAX", 10.0)
    vehicle.run_until(lambda v: v.position[0] > 30.0)
    vehicle.lag_s, vehicle.wind = 2.0, (0.0, 2.5, 0.0)
    vehicle.run_until(lambda v: v.setpoints[-1].position_ned[1] > 5.0, 30.0)
    vehicle.lag_s, vehicle.wind = 0.05, (0.0, 0.0, 0.0)
    vehicle.run_until(completed, 60.0)
    assert nearest(vehicle, (40.0, 0.0, -5.0)) < 1.0


def test_the_setpoint_is_continuous_and_within_its_limits() -> None:
    vehicle = start(ready(), *square())
    vehicle.run_until(lambda v: v.position[0] > 10.0)
    vehicle.send(Command.DO_PAUSE_CONTINUE, 0.0)
    vehicle.send(Command.DO_PAUSE_CONTINUE, 1.0)
    vehicle.run_until(lambda v: len(v.reached) == 4)
    flown = [s for s in vehicle.setpoints if not any(map(math.isnan, s.position_ned))]
    for before, after in pairwise(flown):
        step_s = (after.time_us - before.time_us) * 1e-6
        assert math.dist(before.position_ned, after.position_ned) <= 5.0 * step_s + 1e-3
        assert math.dist(before.velocity_ned, after.velocity_ned) <= 5.0 * step_s + 1e-3
    assert max(math.hypot(*s.velocity_ned[:2]) for s in flown) <= 5.0 + 1e-6


def test_home_is_where_the_vehicle_was_armed() -> None:
    vehicle = ready()
    vehicle.position = (3.0, 4.0, 0.0)
    vehicle.run(0.1)
    assert vehicle.arm() == ACCEPTED
    assert vehicle.home.value is not None
    assert vehicle.home.value.position_ned == pytest.approx((3.0, 4.0, 0.0))
    assert vehicle.home.value.latitude_deg > HOME[0]


def test_a_landing_broken_off_climbs_back_to_its_abort_altitude() -> None:
    land = item(1, 21, param1=4.0, param4=math.nan)
    vehicle = start(ready(), takeoff(height=10.0), land)
    vehicle.run_until(lambda v: len(v.reached) == 1)
    vehicle.run_until(lambda v: v.height < 1.5)
    assert vehicle.send(Command.DO_PAUSE_CONTINUE, 0.0) == ACCEPTED
    vehicle.run(8.0)
    assert vehicle.height == pytest.approx(4.0, abs=0.1)


def test_an_item_without_autocontinue_waits_for_a_command() -> None:
    vehicle = start(ready(), takeoff(), waypoint(1, 10, 0, autocontinue=0.0), waypoint(2, 20, 0))
    vehicle.run(30.0)
    assert vehicle.reached == [0, 1]
    assert vehicle.send(Command.DO_SET_MISSION_CURRENT, 2.0) == ACCEPTED
    vehicle.run_until(completed, 30.0)


places = st.tuples(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0), st.floats(2.0, 12.0))
kinds = st.one_of(
    st.tuples(st.just("waypoint"), places, st.sampled_from([0.0, 0.0, 1.0])),
    st.tuples(st.just("speed"), st.floats(0.5, 12.0), st.just(0.0)),
    st.tuples(st.just("delay"), st.floats(0.0, 2.0), st.just(0.0)),
)


def built(seq: int, kind: tuple[Any, Any, float]) -> MissionItem:
    name, value, hold = kind
    if name == "waypoint":
        return waypoint(seq, *value, param1=hold)
    if name == "speed":
        return item(seq, 178, param1=1.0, param2=value, param3=-1.0)
    return item(seq, 93, param1=value)


@pytest.mark.thorough
@settings(deadline=None, max_examples=25)
@given(st.lists(kinds, min_size=1, max_size=6), st.lists(st.floats(0.5, 20.0), max_size=3))
def test_any_mission_is_flown_to_its_end_whenever_it_is_paused(
    plan: list[tuple[Any, Any, float]], pauses: list[float]
) -> None:
    items = (takeoff(), *(built(seq, kind) for seq, kind in enumerate(plan, start=1)))
    vehicle = start(ready(), *items)
    for seconds in pauses:
        vehicle.run(seconds)
        vehicle.send(Command.DO_PAUSE_CONTINUE, 0.0)
        vehicle.run(1.0)
        vehicle.send(Command.DO_PAUSE_CONTINUE, 1.0)
    vehicle.run_until(completed, 900.0)
    assert vehicle.reached == list(range(len(items)))
    for entry, (name, value, _) in zip(items[1:], plan, strict=True):
        if name == "waypoint":
            assert nearest(vehicle, (value[0], value[1], -value[2])) <= entry.param2
