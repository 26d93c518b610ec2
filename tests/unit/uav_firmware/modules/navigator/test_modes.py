"""Take-off, hold, reposition, land and return, flown by a kinematic vehicle."""

import math

import pytest

from tests.support.toy_vehicle import HOME, ToyVehicle, at
from uav_firmware.msg.estimate import TerrainEstimate
from uav_firmware.msg.failure import FailureDetectorStatus
from uav_firmware.msg.sensors import SensorRange
from uav_firmware.msg.status import Command, NavigationState

ACCEPTED, NOT_NOW = 0, 1
NAN = math.nan


def airborne(height: float = 5.0) -> ToyVehicle:
    """A vehicle that hovers above home."""
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    altitude = HOME[2] + height
    assert vehicle.send(Command.NAV_TAKEOFF, -1.0, 0, 0, NAN, NAN, NAN, altitude) == ACCEPTED
    assert vehicle.arm() == ACCEPTED
    vehicle.run_until(lambda v: v.mode is NavigationState.AUTO_LOITER, 60.0)
    return vehicle


def fly_to(vehicle: ToyVehicle, north: float, east: float, height: float = 5.0) -> None:
    place = at(north, east)
    result = vehicle.send(
        Command.DO_REPOSITION, -1.0, 1.0, 0.0, NAN, place["x"], place["y"], HOME[2] + height
    )
    assert result == ACCEPTED
    goal = (north, east, -height)
    vehicle.run_until(lambda v: math.dist(v.position, goal) < 0.05, 120.0)
    vehicle.run(2.0)


def test_a_take_off_ends_in_hold_at_its_height() -> None:
    vehicle = airborne(10.0)
    vehicle.run(5.0)
    assert vehicle.height == pytest.approx(10.0, abs=0.05)
    assert math.hypot(*vehicle.position[:2]) < 0.05


@pytest.mark.parametrize("altitude", [NAN, 10.0, HOME[2] - 3.0])
def test_a_take_off_without_a_sensible_height_goes_to_the_default(altitude: float) -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    assert vehicle.arm() == ACCEPTED
    assert vehicle.send(Command.NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, altitude) == ACCEPTED
    vehicle.run_until(lambda v: v.mode is NavigationState.AUTO_LOITER, 60.0)
    assert vehicle.height == pytest.approx(2.5, abs=0.1)
    assert any("MIS_TAKEOFF_ALT" in text for text in vehicle.texts)


def test_a_take_off_command_goes_to_its_point_and_turns() -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    place = at(6, 8)
    values = (0.0, 0.0, 0.0, 90.0, place["x"], place["y"], HOME[2] + 5.0)
    assert vehicle.send(Command.NAV_TAKEOFF, *values) == ACCEPTED
    assert vehicle.arm() == ACCEPTED
    vehicle.run_until(lambda v: v.mode is NavigationState.AUTO_LOITER, 60.0)
    assert math.dist(vehicle.position, (6, 8, -5)) < 0.1
    assert vehicle.yaw == pytest.approx(math.pi / 2, abs=0.02)


def test_a_take_off_in_the_air_never_descends() -> None:
    vehicle = airborne(10.0)
    altitude = HOME[2] + 4.0
    assert vehicle.send(Command.NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, altitude) == ACCEPTED
    vehicle.run(10.0)
    assert vehicle.height == pytest.approx(10.0, abs=0.1)


@pytest.mark.first_case
@pytest.mark.parametrize(
    "order",
    [
        (Command.DO_PAUSE_CONTINUE, 0.0),
        (Command.DO_SET_MODE, 1.0, 4.0, 3.0),
        (Command.NAV_LOITER_UNLIM,),
        (Command.DO_REPOSITION, -1.0, 1.0, 0.0, NAN, NAN, NAN, NAN),
    ],
)
def test_every_order_to_hold_stops_a_reposition(order: tuple[float, ...]) -> None:
    vehicle = airborne()
    place = at(100, 0)
    vehicle.send(Command.DO_REPOSITION, -1.0, 1.0, 0.0, NAN, place["x"], place["y"], HOME[2] + 5)
    vehicle.run_until(lambda v: v.position[0] > 30.0)
    assert vehicle.send(int(order[0]), *order[1:]) == ACCEPTED
    vehicle.run(6.0)
    assert vehicle.position[0] < 40.0
    assert math.hypot(*vehicle.velocity) < 0.01


def test_a_reposition_at_a_speed_keeps_to_it() -> None:
    vehicle = airborne()
    place = at(30, 0)
    vehicle.send(Command.DO_REPOSITION, 1.5, 1.0, 0.0, NAN, place["x"], place["y"], HOME[2] + 5)
    vehicle.run_until(lambda v: v.position[0] > 15.0)
    assert vehicle.velocity[0] == pytest.approx(1.5, abs=0.05)


def test_a_reposition_by_height_and_yaw_alone_stays_over_its_point() -> None:
    vehicle = airborne()
    fly_to(vehicle, 10.0, 0.0)
    vehicle.send(Command.DO_REPOSITION, -1.0, 1.0, 0.0, 1.0, NAN, NAN, HOME[2] + 8.0)
    vehicle.run(8.0)
    assert math.dist(vehicle.position, (10, 0, -8)) < 0.05
    assert vehicle.yaw == pytest.approx(1.0, abs=0.01)


def test_landing_on_the_spot_disarms() -> None:
    vehicle = airborne()
    fly_to(vehicle, 5.0, 5.0)
    assert vehicle.set_mode(6) == ACCEPTED
    vehicle.run_until(lambda v: not v.armed, 60.0)
    assert math.dist(vehicle.position, (5, 5, 0)) < 0.1
    assert vehicle.mode is NavigationState.AUTO_LOITER


def touch_down_speed(vehicle: ToyVehicle) -> float:
    """Sink [m/s] commanded just above the ground."""
    assert vehicle.set_mode(6) == ACCEPTED
    vehicle.run_until(lambda v: v.height < 0.1, 60.0)
    return vehicle.setpoints[-1].velocity_ned[2]


def test_a_vehicle_that_spins_on_three_rotors_touches_down_at_half_the_speed() -> None:
    whole, broken = airborne(), airborne()
    broken.failure.publish(FailureDetectorStatus(broken.now_us, False, False, 0b0100))
    assert touch_down_speed(broken) == pytest.approx(0.5 * touch_down_speed(whole), rel=0.02)


@pytest.mark.first_case
@pytest.mark.parametrize("lost_at_m", [0.6, 2.0, 4.0])
def test_a_vehicle_that_has_just_lost_a_motor_waits_above_the_ground_until_it_cones_no_more(
    lost_at_m: float,
) -> None:
    vehicle = airborne()
    assert vehicle.set_mode(6) == ACCEPTED
    vehicle.run_until(lambda v: v.height < lost_at_m, 60.0)
    vehicle.failure.publish(FailureDetectorStatus(vehicle.now_us, False, False, 0b0100))
    vehicle.run(5.0)
    waits_from = len(vehicle.track)
    vehicle.run(6.9)
    assert all(1.8 < -place[2] < 2.2 for place in vehicle.track[waits_from:])
    vehicle.run_until(lambda v: v.height < 0.1, 10.0)
    assert vehicle.setpoints[-1].velocity_ned[2] < 0.25
    vehicle.run_until(lambda v: not v.armed, 10.0)


def test_a_vehicle_that_loses_a_motor_as_it_touches_the_ground_does_not_rise() -> None:
    """A blade of grass may stop a rotor."""
    vehicle = airborne()
    assert vehicle.set_mode(6) == ACCEPTED
    vehicle.run_until(lambda v: v.height <= 0.0, 60.0)
    vehicle.run(0.1)
    vehicle.failure.publish(FailureDetectorStatus(vehicle.now_us, False, False, 0b0100))
    while vehicle.armed:
        vehicle.step()
        assert vehicle.setpoints[-1].velocity_ned[2] > 0.0


def test_a_landing_long_after_a_motor_was_lost_does_not_wait() -> None:
    vehicle = airborne()
    vehicle.failure.publish(FailureDetectorStatus(vehicle.now_us, False, False, 0b0100))
    vehicle.registry.set("COM_ACT_FAIL_ACT", 0)
    vehicle.run(12.0)
    assert vehicle.set_mode(6) == ACCEPTED
    vehicle.run_until(lambda v: v.height < 0.1, 15.0)


@pytest.mark.first_case
@pytest.mark.parametrize("too_high_m", [-30.0, -3.0, 0.0])
def test_a_landing_is_slow_near_the_ground_that_is_measured(too_high_m: float) -> None:
    """Wherever the place that was ordered puts the ground."""
    vehicle = airborne(20.0)
    vehicle.ground_m = 0.0
    values = (0.0, 0.0, 0.0, NAN, HOME[0], HOME[1], too_high_m)
    assert vehicle.send(Command.NAV_LAND, *values, frame=3) == ACCEPTED
    vehicle.run_until(lambda v: v.height < 8.0, 60.0)
    assert vehicle.setpoints[-1].velocity_ned[2] == pytest.approx(1.5)
    vehicle.run_until(lambda v: v.height < 0.1, 60.0)
    assert vehicle.setpoints[-1].velocity_ned[2] < 0.5


def test_a_landing_is_fast_far_above_the_ground_that_is_measured() -> None:
    vehicle = airborne(30.0)
    vehicle.ground_m = 0.0
    values = (0.0, 0.0, 0.0, NAN, HOME[0], HOME[1], 29.0)
    assert vehicle.send(Command.NAV_LAND, *values, frame=3) == ACCEPTED
    vehicle.run(8.0)
    assert vehicle.setpoints[-1].velocity_ned[2] == pytest.approx(1.5)
    vehicle.run_until(lambda v: not v.armed, 90.0)


def test_a_landing_goes_by_home_where_no_ground_is_measured_any_more() -> None:
    vehicle = airborne(10.0)
    vehicle.ground_m = -20.0
    vehicle.run(0.1)
    vehicle.ground_m = None
    vehicle.run(1.0)
    assert touch_down_speed(vehicle) < 0.5


@pytest.mark.first_case
@pytest.mark.parametrize("descent_speed", [1.5, 4.0])
@pytest.mark.parametrize("stuck_m", [32.3, 31.0, 30.5])
def test_a_range_finder_that_gets_stuck_makes_no_slow_landing_fast(
    stuck_m: float, descent_speed: float
) -> None:
    """On ground 30 m above home, until the vehicle has sunk through it."""
    vehicle = airborne(45.0)
    vehicle.registry.set("MPC_Z_V_AUTO_DN", descent_speed)
    vehicle.ground_m = 30.0
    vehicle.send(Command.NAV_LAND, 0, 0, 0, NAN, NAN, NAN, NAN)
    vehicle.run_until(lambda v: v.height < stuck_m, 60.0)
    vehicle.ground_m = None
    vehicle.topics.terrain_estimate.publish(TerrainEstimate(vehicle.now_us, NAN, has_failed=True))
    while vehicle.height > 29.0:
        vehicle.step()
        assert vehicle.setpoints[-1].velocity_ned[2] < 0.71
    vehicle.run_until(lambda v: v.setpoints[-1].velocity_ned[2] > 1.4, 5.0)
    vehicle.run_until(lambda v: not v.armed, 60.0)


@pytest.mark.parametrize("is_stuck", [True, False], ids=["stuck", "silent"])
@pytest.mark.parametrize("fails_at_m", [25.0, 12.0])
def test_a_landing_without_its_range_finder_is_slow_where_the_ground_may_be(
    fails_at_m: float, *, is_stuck: bool
) -> None:
    """A field may rise 10 m above home."""
    vehicle = airborne(30.0)
    vehicle.send(Command.NAV_LAND, 0, 0, 0, NAN, NAN, NAN, NAN)
    track: list[tuple[float, float]] = []  # Height, speed downwards
    while vehicle.armed:
        works = vehicle.height > fails_at_m
        if works or is_stuck:
            vehicle.range_finder.publish(SensorRange(vehicle.now_us, vehicle.height, 0.1, 40.0))
        if not works and is_stuck:
            failed = TerrainEstimate(vehicle.now_us, NAN, has_failed=True)
            vehicle.topics.terrain_estimate.publish(failed)
        vehicle.step()
        track.append((vehicle.height, vehicle.setpoints[-1].velocity_ned[2]))
    assert max(speed for height, speed in track if height > 16.0) == pytest.approx(1.5)
    slow_below_m = min(14.0, fails_at_m - 3.0)
    assert max(speed for height, speed in track if height < slow_below_m) < 0.71


def test_a_vehicle_that_never_had_a_range_finder_descends_by_home() -> None:
    vehicle = airborne(20.0)
    vehicle.send(Command.NAV_LAND, 0, 0, 0, NAN, NAN, NAN, NAN)
    vehicle.run_until(lambda v: v.height < 9.0, 60.0)
    assert vehicle.setpoints[-1].velocity_ned[2] == pytest.approx(1.5)


@pytest.mark.parametrize("lost_at_m", [0.6, 2.0])
def test_ground_that_is_suddenly_seen_deeper_does_not_let_a_coning_vehicle_touch_down(
    lost_at_m: float,
) -> None:
    """A range finder that gets stuck with the motor shows it, until the climb proves it wrong."""
    vehicle = airborne()
    vehicle.ground_m = 0.0
    assert vehicle.set_mode(6) == ACCEPTED
    vehicle.run_until(lambda v: v.height < lost_at_m, 60.0)
    vehicle.ground_m = -6.0
    vehicle.run(0.05)
    vehicle.failure.publish(FailureDetectorStatus(vehicle.now_us, False, False, 0b0100))
    vehicle.run(5.0)
    vehicle.ground_m = None
    vehicle.topics.terrain_estimate.publish(TerrainEstimate(vehicle.now_us, NAN, has_failed=True))
    vehicle.run(2.0)
    waits_from = len(vehicle.track)
    vehicle.run(4.0)
    assert all(1.8 < -place[2] < 2.2 for place in vehicle.track[waits_from:])
    vehicle.run_until(lambda v: not v.armed, 40.0)


def test_a_place_under_the_ground_is_not_flown_to() -> None:
    vehicle = airborne(10.0)
    vehicle.ground_m = 0.0
    values = (-1.0, 1.0, 0.0, NAN, HOME[0], HOME[1], HOME[2] - 40.0)
    assert vehicle.send(Command.DO_REPOSITION, *values) == ACCEPTED
    vehicle.run(30.0)
    assert vehicle.height == pytest.approx(2.0, abs=0.1)
    assert "Place is under the ground: holding above the ground" in vehicle.texts


def test_a_land_command_with_a_place_lands_there() -> None:
    vehicle = airborne()
    place = at(-7, 12)
    values = (0.0, 0.0, 0.0, NAN, place["x"], place["y"], 0.0)
    assert vehicle.send(Command.NAV_LAND, *values, frame=3) == ACCEPTED
    vehicle.run_until(lambda v: not v.armed, 60.0)
    assert math.dist(vehicle.position, (-7, 12, 0)) < 0.1


@pytest.mark.thorough
def test_a_landing_on_ground_lower_than_thought_still_ends_on_the_ground() -> None:
    vehicle = airborne(10.0)
    here = vehicle.position
    values = (0.0, 0.0, 0.0, NAN, HOME[0], HOME[1], 6.0)
    assert vehicle.send(Command.NAV_LAND, *values, frame=3) == ACCEPTED
    vehicle.run_until(lambda v: not v.armed, 90.0)
    assert vehicle.height <= 0.0 < -here[2]


@pytest.mark.thorough
def test_return_from_afar_climbs_first_then_flies_then_lands() -> None:
    vehicle = airborne()
    fly_to(vehicle, 60.0, 0.0)
    before = len(vehicle.track)
    assert vehicle.set_mode(5) == ACCEPTED
    vehicle.run_until(lambda v: not v.armed, 180.0)
    track = vehicle.track[before:]
    assert math.hypot(*vehicle.position[:2]) < 0.1
    assert max(-p[2] for p in track) == pytest.approx(20.0, abs=0.2)
    assert all(-p[2] > 19.0 for p in track if 2.0 < p[0] < 58.0)


def test_return_from_close_by_does_not_climb() -> None:
    vehicle = airborne()
    fly_to(vehicle, 6.0, 0.0)
    before = len(vehicle.track)
    assert vehicle.send(Command.NAV_RETURN_TO_LAUNCH) == ACCEPTED
    vehicle.run_until(lambda v: not v.armed, 120.0)
    assert max(-p[2] for p in vehicle.track[before:]) < 5.3


@pytest.mark.thorough
def test_return_can_wait_above_home() -> None:
    vehicle = airborne()
    vehicle.registry.set("RTL_LAND_DELAY", -1.0)
    fly_to(vehicle, 40.0, 0.0)
    assert vehicle.set_mode(5) == ACCEPTED
    vehicle.run(90.0)
    assert vehicle.armed
    assert math.dist(vehicle.position, (0, 0, -10)) < 0.1


def test_without_a_valid_position_the_vehicle_sinks_to_the_ground() -> None:
    vehicle = airborne()
    vehicle.position_valid = False
    vehicle.run(1.5)
    assert vehicle.mode is NavigationState.AUTO_LAND
    vehicle.run_until(lambda v: not v.armed, 60.0)


def test_an_armed_vehicle_on_the_ground_is_not_commanded_to_climb() -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    assert vehicle.arm() == ACCEPTED
    vehicle.run(3.0)
    assert vehicle.setpoints[-1].velocity_ned[2] > 0.0
    assert math.isnan(vehicle.setpoints[-1].position_ned[2])
