"""When the estimate is reset, what is held moves with it and what lies on the earth does not."""

import math

import pytest

from tests.support.toy_vehicle import HOME, ToyVehicle, at, takeoff, waypoint
from tests.unit.uav_firmware.modules.navigator.test_modes import airborne, fly_to
from uav_firmware.msg.status import Command, NavigationState
from uav_firmware.msg.vectors import Vector3

NAN = math.nan
STEP = (20.0, -15.0)


def speed_after(vehicle: ToyVehicle, seconds: float) -> float:
    """Largest horizontal speed that is flown [m/s], by the kinematic vehicle itself."""
    worst = 0.0
    for _ in range(round(seconds * 10)):
        vehicle.run(0.1)
        worst = max(worst, math.hypot(*vehicle.velocity[:2]))
    return worst


def test_a_hovering_vehicle_does_not_move_when_its_estimate_leaps() -> None:
    vehicle = airborne()
    vehicle.run(3.0)
    vehicle.reset(*STEP, 4.0)
    before = vehicle.position
    assert speed_after(vehicle, 5.0) < 0.05
    assert vehicle.position == pytest.approx(before, abs=0.05)


def test_a_reposition_is_flown_on_to_its_place_on_the_earth_within_its_speeds() -> None:
    vehicle = airborne()
    place = at(60.0, 0.0)
    vehicle.send(Command.DO_REPOSITION, -1.0, 1.0, 0.0, NAN, place["x"], place["y"], HOME[2] + 5.0)
    vehicle.run(6.0)
    cruise = math.hypot(*vehicle.velocity[:2])
    vehicle.reset(*STEP)
    assert speed_after(vehicle, 40.0) < cruise + 0.6
    assert vehicle.position == pytest.approx((60.0, 0.0, -5.0), abs=0.1)


def test_a_landing_in_hand_comes_down_where_the_vehicle_is() -> None:
    vehicle = airborne(10.0)
    vehicle.send(Command.NAV_LAND)
    vehicle.run(2.0)
    vehicle.reset(*STEP)
    before = vehicle.position
    vehicle.run_until(lambda v: v.landed, 60.0)
    assert vehicle.position[:2] == pytest.approx(before[:2], abs=0.1)


def test_a_mission_passes_all_its_waypoints_after_a_reset() -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    vehicle.upload(takeoff(), waypoint(1, 40.0, 0.0), waypoint(2, 40.0, 40.0))
    vehicle.run(0.2)
    vehicle.set_mode(4)
    vehicle.arm()
    vehicle.run_until(lambda v: v.position[0] > 15.0, 60.0)
    vehicle.reset(*STEP)
    vehicle.run_until(lambda v: v.reached[-1:] == [2], 90.0)
    assert vehicle.reached == [0, 1, 2]
    vehicle.run(5.0)
    assert vehicle.position[:2] == pytest.approx((40.0, 40.0), abs=0.3)


@pytest.mark.thorough
def test_an_orbit_goes_back_to_its_circle_on_the_earth() -> None:
    vehicle = airborne()
    fly_to(vehicle, 10.0, 0.0)
    place = at(10.0, 10.0)
    vehicle.send(Command.DO_ORBIT, 10.0, 3.0, 0.0, 0.0, place["x"], place["y"], HOME[2] + 5.0)
    vehicle.run(12.0)
    vehicle.reset(*STEP)
    assert speed_after(vehicle, 30.0) < 6.0
    away = [math.dist(here[:2], (10.0, 10.0)) for here in positions_during(vehicle, 10.0)]
    assert away == pytest.approx([10.0] * len(away), abs=0.5)
    assert vehicle.mode is NavigationState.ORBIT


def positions_during(vehicle: ToyVehicle, seconds: float) -> list[Vector3]:
    places = []
    for _ in range(round(seconds)):
        vehicle.run(1.0)
        places.append(vehicle.position)
    return places
