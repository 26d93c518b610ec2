"""Regions of interest, turns, conditions, circles and climbs: as commands and as items."""

import itertools
import math

import pytest

from tests.support.toy_vehicle import HOME, NAN, ToyVehicle, at, item, takeoff, waypoint
from tests.unit.uav_firmware.modules.navigator.test_modes import airborne
from uav_firmware.lib.rotation import wrap_pi
from uav_firmware.msg.mission import MissionItem, MissionState
from uav_firmware.msg.status import Command

ACCEPTED, NOT_NOW, DENIED = 0, 1, 2


def flying(*items: MissionItem) -> ToyVehicle:
    """A vehicle whose mission has just been started on the ground."""
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    assert vehicle.check_mission(items) is None
    vehicle.upload(*items)
    assert vehicle.set_mode(4) == ACCEPTED
    assert vehicle.arm() == ACCEPTED
    return vehicle


def complete(vehicle: ToyVehicle) -> None:
    vehicle.run_until(lambda v: v.state == MissionState.COMPLETE, 200.0)


def looks_at(vehicle: ToyVehicle, north: float, east: float) -> float:
    """Angle [rad] between the nose and the direction of a place."""
    wanted = math.atan2(east - vehicle.position[1], north - vehicle.position[0])
    return abs(wrap_pi(vehicle.yaw - wanted))


def test_the_nose_follows_a_region_of_interest_until_there_is_none() -> None:
    vehicle = airborne()
    place = at(20.0, 20.0)
    values = (0.0, 0.0, 0.0, 0.0, place["x"], place["y"], HOME[2])
    assert vehicle.send(Command.DO_SET_ROI_LOCATION, *values) == ACCEPTED
    vehicle.run(8.0)
    assert looks_at(vehicle, 20.0, 20.0) < 0.01
    there = at(30.0, 0.0)
    order = (-1.0, 1.0, 0.0, NAN, there["x"], there["y"], NAN)
    assert vehicle.send(Command.DO_REPOSITION, *order) == ACCEPTED
    for _ in range(40):
        vehicle.run(0.25)
        assert looks_at(vehicle, 20.0, 20.0) < 0.1
    assert vehicle.send(Command.DO_SET_ROI_NONE) == ACCEPTED
    yaw = vehicle.yaw
    vehicle.run(3.0)
    assert vehicle.yaw == pytest.approx(yaw, abs=0.05)


@pytest.mark.parametrize(
    ("mode", "latitude", "result"),
    [(3.0, HOME[0], ACCEPTED), (0.0, 0.0, ACCEPTED), (1.0, 0.0, DENIED), (3.0, 95.0, DENIED)],
)
def test_the_old_command_for_a_region_is_understood(
    mode: float, latitude: float, result: int
) -> None:
    vehicle = airborne()
    longitude = HOME[1] if mode == 3.0 else 0.0
    values = (mode, 0.0, 0.0, 0.0, latitude, longitude, HOME[2] if mode == 3.0 else 0.0)
    assert vehicle.send(Command.DO_SET_ROI, *values) == result


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("values", "expected", "sense"),
    [
        ((90.0, 0.0, 0.0, 0.0), 90.0, 1.0),
        ((90.0, 30.0, -1.0, 0.0), 90.0, -1.0),
        ((30.0, 20.0, 1.0, 1.0), 30.0, 1.0),
        ((30.0, 20.0, -1.0, 1.0), -30.0, -1.0),
        ((-45.0, NAN, NAN, 1.0), -45.0, -1.0),
        ((270.0, 40.0, 1.0, 1.0), -90.0, 1.0),
    ],
)
def test_a_turn_has_its_direction_and_ends_at_its_heading(
    values: tuple[float, ...], expected: float, sense: float
) -> None:
    vehicle = airborne()
    vehicle.run(1.0)
    assert vehicle.yaw == pytest.approx(0.0, abs=1e-6)
    assert vehicle.send(Command.CONDITION_YAW, *values) == ACCEPTED
    rates = []
    for _ in range(200):
        vehicle.run(0.1)
        rates.append(vehicle.setpoints[-1].yaw_rate)
    assert abs(wrap_pi(vehicle.yaw - math.radians(expected))) < 1e-3
    assert all(rate * sense >= -1e-6 for rate in rates)
    if values[1] > 0.0:
        assert max(map(abs, rates)) <= math.radians(values[1]) + 1e-6


@pytest.mark.parametrize(
    ("values", "result"),
    [
        ((400.0,), DENIED),
        ((NAN,), DENIED),
        ((10.0, -1.0), DENIED),
        ((10.0, 0.0, 2.0), DENIED),
        ((10.0, 0.0, 0.0, 2.0), DENIED),
    ],
)
def test_a_turn_that_is_none_is_denied(values: tuple[float, ...], result: int) -> None:
    assert airborne().send(Command.CONDITION_YAW, *values) == result


def test_a_turn_is_refused_where_the_mode_has_its_own_heading() -> None:
    vehicle = airborne()
    assert vehicle.send(Command.DO_ORBIT, 10.0, 2.0, 0.0, 0.0, NAN, NAN, NAN) == ACCEPTED
    assert vehicle.send(Command.CONDITION_YAW, 90.0) == NOT_NOW


def test_a_turn_as_an_item_is_made_at_rest_and_kept_for_the_next_leg() -> None:
    vehicle = flying(
        takeoff(),
        waypoint(1, 10.0, 0.0),
        item(2, 115, param1=90.0, param2=45.0),
        waypoint(3, 20.0, 0.0),
        waypoint(4, 20.0, 10.0),
    )
    vehicle.run_until(lambda v: 2 in v.reached)
    assert math.hypot(*vehicle.velocity) < 0.05
    assert vehicle.yaw == pytest.approx(math.radians(90.0), abs=1e-3)
    vehicle.run_until(lambda v: 3 in v.reached)
    assert vehicle.yaw == pytest.approx(math.radians(90.0), abs=0.3)
    complete(vehicle)
    assert vehicle.reached == [0, 1, 2, 3, 4]


def test_a_region_as_an_item_does_not_stop_the_flight() -> None:
    vehicle = flying(
        takeoff(),
        waypoint(1, 20.0, 0.0),
        item(2, 195, frame=3, z=0.0, **at(30.0, 30.0)),
        waypoint(3, 40.0, 0.0),
        waypoint(4, 60.0, 0.0),
        item(5, 197),
    )
    vehicle.run_until(lambda v: 2 in v.reached)
    assert math.hypot(*vehicle.velocity) > 3.0
    vehicle.run_until(lambda v: 4 in v.reached)
    assert looks_at(vehicle, 30.0, 30.0) < 0.05
    complete(vehicle)


def test_turns_of_a_mission_are_flown_round_with_the_region_in_view() -> None:
    vehicle = flying(
        takeoff(),
        item(1, 195, frame=3, z=0.0, **at(20.0, 0.0)),
        waypoint(2, 20.0, -8.0),
        item(3, 18, param1=1.5, param3=-8.0, z=5.0, **at(20.0, 0.0)),
    )
    vehicle.run_until(lambda v: 2 in v.reached)
    bearings: list[float] = []

    def done(v: ToyVehicle) -> bool:
        bearings.append(math.atan2(v.position[1], v.position[0] - 20.0))
        return v.state == MissionState.COMPLETE

    vehicle.run_until(done, 120.0)
    turned = sum(wrap_pi(b - a) for a, b in itertools.pairwise(bearings))
    assert turned == pytest.approx(-1.5 * math.tau, abs=0.1)
    assert looks_at(vehicle, 20.0, 0.0) < 0.05


def test_without_a_region_turns_are_flown_forwards_and_with_the_default_radius() -> None:
    vehicle = flying(takeoff(), item(1, 18, param1=1.0, z=5.0, **at(20.0, 0.0)))
    vehicle.run_until(lambda v: v.orbit_status.value is not None, 60.0)
    vehicle.run_until(lambda v: v.orbit_status.value.turned > 2.0, 60.0)  # type: ignore[union-attr]  # just seen
    setpoint = vehicle.setpoints[-1]
    ahead = math.atan2(setpoint.velocity_ned[1], setpoint.velocity_ned[0])
    assert abs(wrap_pi(setpoint.yaw - ahead)) < 0.05
    assert math.dist(setpoint.position_ned[:2], (20.0, 0.0)) == pytest.approx(10.0, abs=0.01)
    complete(vehicle)


def test_during_a_condition_delay_the_vehicle_flies_on() -> None:
    vehicle = flying(
        takeoff(),
        waypoint(1, 20.0, 0.0),
        item(2, 112, param1=2.0),
        item(3, 178, param1=1.0, param2=2.0),
        waypoint(4, 80.0, 0.0),
    )
    vehicle.run_until(lambda v: 1 in v.reached)
    passed_us = vehicle.now_us
    assert math.hypot(*vehicle.velocity) > 3.0
    vehicle.run_until(lambda v: 3 in v.reached)
    assert (vehicle.now_us - passed_us) * 1e-6 == pytest.approx(2.0, abs=0.1)
    assert vehicle.position[0] > 27.0
    vehicle.run(4.0)
    assert math.hypot(*vehicle.velocity) == pytest.approx(2.0, abs=0.1)
    complete(vehicle)
    assert vehicle.reached == [0, 1, 2, 3, 4]


@pytest.mark.thorough
def test_a_condition_distance_is_waited_for_during_the_leg() -> None:
    vehicle = flying(
        takeoff(),
        waypoint(1, 20.0, 0.0),
        item(2, 114, param1=15.0),
        item(3, 195, frame=3, z=0.0, **at(60.0, 30.0)),
        waypoint(4, 60.0, 0.0),
    )
    vehicle.run_until(lambda v: 2 in v.reached)
    assert vehicle.position[0] == pytest.approx(45.0, abs=0.5)
    complete(vehicle)


def test_a_distance_with_nothing_to_fly_to_does_not_block() -> None:
    vehicle = flying(takeoff(), waypoint(1, 10.0, 0.0), item(2, 114, param1=5.0), item(3, 20))
    vehicle.run_until(lambda v: not v.armed, 120.0)
    assert vehicle.reached == [0, 1, 2, 3]


def test_a_change_of_height_is_made_over_the_place() -> None:
    vehicle = flying(takeoff(), item(1, 31, z=15.0, **at(20.0, 0.0)))
    vehicle.run_until(lambda v: v.height > 6.0)
    assert vehicle.position[0] == pytest.approx(20.0, abs=0.2)
    complete(vehicle)
    assert vehicle.height == pytest.approx(15.0, abs=0.5)


def test_a_spline_waypoint_is_flown_through() -> None:
    vehicle = flying(
        takeoff(),
        item(1, 82, z=5.0, **at(20.0, 0.0)),
        item(2, 82, z=5.0, **at(20.0, 20.0)),
        waypoint(3, 0.0, 20.0),
    )
    vehicle.run_until(lambda v: 1 in v.reached)
    assert math.hypot(*vehicle.velocity) > 0.8
    vehicle.run_until(lambda v: 2 in v.reached)
    assert math.hypot(*vehicle.velocity) > 0.8
    complete(vehicle)


def test_home_is_set_by_an_item() -> None:
    vehicle = flying(
        takeoff(), waypoint(1, 15.0, 0.0), item(2, 179, param1=1.0), waypoint(3, 30, 0)
    )
    complete(vehicle)
    home = vehicle.home.value
    assert home is not None
    assert home.position_ned[0] == pytest.approx(15.0, abs=2.0)


@pytest.mark.parametrize(
    ("bad", "parameter"),
    [
        (item(1, 18, param1=0.0, z=5.0, **at(9, 0)), 1),
        (item(1, 18, param1=1.0, param3=0.4, z=5.0, **at(9, 0)), 3),
        (item(1, 18, param1=1.0, param2=1.0, z=5.0, **at(9, 0)), 2),
        (item(1, 112, param1=-1.0), 1),
        (item(1, 114, param1=NAN), 1),
        (item(1, 115, param1=900.0), 1),
        (item(1, 115, param1=90.0, param3=5.0), 3),
        (item(1, 179, param1=2.0), 1),
        (item(1, 195, frame=3, x=95.0, y=0.0), 5),
        (item(1, 201, param1=2.0), 1),
        (item(1, 197, param1=2.0), 1),
    ],
)
def test_items_that_ask_for_nothing_possible_are_refused(bad: MissionItem, parameter: int) -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    rejection = vehicle.check_mission((takeoff(), bad))
    assert rejection is not None
    assert rejection.seq == 1
    assert rejection.result == 5 + parameter


def test_a_circle_across_the_fence_is_refused_in_a_mission() -> None:
    vehicle = ToyVehicle()
    vehicle.registry.set("GF_MAX_HOR_DIST", 30.0)
    vehicle.run(0.5)
    circle = item(1, 18, param1=1.0, param3=9.0, z=5.0, **at(-25.0, 0.0))
    rejection = vehicle.check_mission((takeoff(), circle))
    assert rejection is not None
    assert "circle" in rejection.reason
