"""A vehicle that the wind keeps away from its setpoint lands where it is, and says so."""

import math

import pytest

from tests.support.toy_vehicle import ToyVehicle, at
from tests.unit.uav_firmware.modules.navigator.test_modes import airborne, fly_to
from uav_firmware.msg.estimate import WindEstimate
from uav_firmware.msg.status import Command, NavigationState
from uav_firmware.msg.vectors import Vector3

NAN = math.nan
STORM: Vector3 = (0.0, 6.0, 0.0)
"""[m/s] It carries the sluggish vehicle 6 m from its setpoint, three times MPC_XY_ERR_MAX."""
UNREACHED = "Cannot reach the landing place: landing here"
GIVEN_UP = "No way home against the wind: landing here"
DRIFTED = "Cannot keep to the landing place: landing here"


def sluggish(height: float = 10.0) -> ToyVehicle:
    """A vehicle that hovers above home, and that wind may carry away."""
    vehicle = airborne(height)
    vehicle.lag_s = 1.0
    return vehicle


def blown_off(height: float = 10.0) -> ToyVehicle:
    """A vehicle in a storm, 5 m off its setpoint."""
    vehicle = sluggish(height)
    vehicle.wind = STORM
    vehicle.run_until(lambda v: v.position[1] > 5.0, 30.0)
    return vehicle


def land(vehicle: ToyVehicle, north: float = NAN, east: float = NAN) -> None:
    place = at(north, east) if not math.isnan(north) else {"x": NAN, "y": NAN}
    vehicle.send(Command.NAV_LAND, 0, 0, 0, NAN, place["x"], place["y"], NAN)


def off_m(vehicle: ToyVehicle) -> float:
    """Level distance [m] from the setpoint."""
    setpoint = vehicle.setpoints[-1].position_ned
    return math.dist(setpoint[:2], vehicle.position[:2])


def test_a_landing_ends_where_a_vehicle_is_that_was_blown_off() -> None:
    vehicle = blown_off()
    vehicle.wind = (0.0, 0.0, 0.0)
    land(vehicle)
    vehicle.run_until(lambda v: not v.armed, 60.0)
    assert vehicle.position[1] > 4.0
    assert UNREACHED not in vehicle.texts


def test_a_landing_against_too_much_wind_descends_after_seconds_and_says_so() -> None:
    vehicle = blown_off()
    land(vehicle)
    vehicle.run_until(lambda v: v.height < 9.0, 10.0)
    vehicle.run_until(lambda v: not v.armed, 60.0)
    assert vehicle.texts.count(UNREACHED) == 1
    assert DRIFTED not in vehicle.texts


def test_a_place_that_cannot_be_reached_is_given_up() -> None:
    vehicle = sluggish()
    vehicle.wind = STORM
    land(vehicle, 0.0, -30.0)
    vehicle.run_until(lambda v: not v.armed, 90.0)
    assert vehicle.texts.count(UNREACHED) == 1
    assert vehicle.position[1] > -30.0 + 3.0


def test_a_vehicle_that_is_blown_away_in_its_descent_does_not_race_back() -> None:
    vehicle = sluggish(20.0)
    land(vehicle)
    vehicle.run_until(lambda v: v.height < 17.0, 10.0)
    vehicle.wind = STORM
    vehicle.run_until(lambda v: v.height < 0.5 or off_m(v) > 2.2, 60.0)
    assert off_m(vehicle) < 2.2
    vehicle.run_until(lambda v: not v.armed, 30.0)
    assert vehicle.texts.count(DRIFTED) == 1


def test_a_slow_turn_over_the_place_is_waited_for() -> None:
    vehicle = sluggish()
    vehicle.lag_s = 0.15
    vehicle.registry.set("MPC_YAWRAUTO_MAX", 5.0)
    place = at(3.0, 4.0)
    vehicle.send(Command.NAV_LAND, 0, 0, 0, 180.0, place["x"], place["y"], NAN)
    vehicle.run_until(lambda v: not v.armed, 120.0)
    assert vehicle.position[:2] == pytest.approx((3.0, 4.0), abs=0.2)
    assert abs(vehicle.yaw) == pytest.approx(math.pi, abs=0.05)


def test_a_slow_way_to_the_place_is_flown_to_its_end() -> None:
    vehicle = sluggish()
    vehicle.registry.set("MPC_XY_CRUISE", 0.5)
    vehicle.registry.set("MPC_XY_ERR_MAX", 0.5)
    land(vehicle, 0.0, 15.0)
    vehicle.run_until(lambda v: not v.armed, 120.0)
    assert vehicle.position[:2] == pytest.approx((0.0, 15.0), abs=0.5)
    assert vehicle.mode is NavigationState.AUTO_LOITER
    assert UNREACHED not in vehicle.texts


@pytest.mark.first_case
@pytest.mark.parametrize(("height", "highest"), [(5.0, 10.0), (10.0, 10.0), (14.0, 14.0)])
def test_a_return_by_too_strong_a_wind_climbs_no_higher_than_it_must(
    height: float, highest: float
) -> None:
    vehicle = airborne(height)
    fly_to(vehicle, 30.0, 0.0, height)
    vehicle.registry.set("COM_FAIL_ACT_T", 0.0)
    vehicle.wind_estimate.publish(WindEstimate(vehicle.now_us, 15.0, 0.0))
    before = len(vehicle.track)
    vehicle.run_until(lambda v: v.mode is NavigationState.AUTO_RTL, 2.0)
    vehicle.run_until(lambda v: not v.armed, 90.0)
    assert max(-p[2] for p in vehicle.track[before:]) == pytest.approx(highest, abs=0.2)
    assert math.hypot(*vehicle.position[:2]) < 0.2


def test_a_return_that_is_blown_away_lands_where_it_is_and_says_so() -> None:
    vehicle = sluggish()
    fly_to(vehicle, 0.0, 40.0, 10.0)
    vehicle.wind = STORM
    assert vehicle.set_mode(5) == 0
    vehicle.run_until(lambda v: GIVEN_UP in v.texts, 30.0)
    vehicle.run_until(lambda v: not v.armed, 90.0)
    assert vehicle.position[1] > 30.0
    assert vehicle.texts.count(GIVEN_UP) == 1
    assert not {UNREACHED, DRIFTED} & set(vehicle.texts)


def test_a_return_whose_wind_abates_comes_home_from_where_the_vehicle_is() -> None:
    vehicle = blown_off()
    vehicle.run_until(lambda v: off_m(v) > 5.5, 30.0)
    vehicle.wind = (0.0, 0.0, 0.0)
    assert vehicle.set_mode(5) == 0
    vehicle.run_until(lambda v: not v.armed, 90.0)
    assert math.hypot(*vehicle.position[:2]) < 0.5
    assert GIVEN_UP not in vehicle.texts
