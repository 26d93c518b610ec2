"""DO_FENCE_ENABLE and DO_LAND_START: by command, in a mission, and when a flight is over."""

import pytest

from tests.support.toy_vehicle import NAN, ToyVehicle, item, takeoff, waypoint
from tests.unit.uav_firmware.modules.navigator.test_modes import airborne, fly_to
from uav_firmware.lib.mission_rules import check_item
from uav_firmware.modules.commander.health_report import SensorBit
from uav_firmware.msg.geofence import FenceBreach
from uav_firmware.msg.mission import MissionResult
from uav_firmware.msg.status import Command

ACCEPTED, DENIED = 0, 2


def switch(vehicle: ToyVehicle, value: float, *others: float) -> int:
    result = vehicle.send(Command.DO_FENCE_ENABLE, value, *others)
    vehicle.run(1.0)
    return result


def fenced() -> ToyVehicle:
    """A vehicle that hovers in a fence of 20 m about home."""
    vehicle = airborne()
    vehicle.registry.set("GF_MAX_HOR_DIST", 20.0)
    vehicle.registry.set("GF_ACTION", 1.0)
    vehicle.run(1.0)
    return vehicle


def is_watched(vehicle: ToyVehicle) -> bool:
    """Whether ground stations see the fence as in use."""
    status, fence = vehicle.status.value, vehicle.geofence_status.value
    assert status is not None
    assert fence is not None
    assert fence.enabled is bool(status.sensors_enabled & SensorBit.GEOFENCE)
    return fence.enabled


def is_breached(vehicle: ToyVehicle) -> bool:
    fence = vehicle.geofence_status.value
    assert fence is not None
    return fence.breach is not FenceBreach.NONE


def test_without_its_fence_the_vehicle_may_leave_it_and_with_it_again_has_left_it() -> None:
    vehicle = fenced()
    assert is_watched(vehicle)
    assert switch(vehicle, 0.0) == ACCEPTED
    assert not is_watched(vehicle)
    fly_to(vehicle, 40.0, 0.0)
    assert not is_breached(vehicle)
    assert switch(vehicle, 1.0) == ACCEPTED
    assert is_watched(vehicle)
    assert is_breached(vehicle)


def test_each_change_is_reported_once() -> None:
    vehicle = fenced()
    for value in (1.0, 0.0, 0.0, 1.0):
        assert switch(vehicle, value) == ACCEPTED
    assert [line for line in vehicle.texts if line.startswith("Geofence o")] == [
        "Geofence off", "Geofence on",
    ]  # fmt: skip


@pytest.mark.parametrize("values", [(2.0,), (3.0,), (-1.0,), (0.5,), (NAN,), (0.0, 1.0)])
def test_what_cannot_be_switched_is_denied(values: tuple[float, ...]) -> None:
    vehicle = fenced()
    assert switch(vehicle, *values) == DENIED
    assert is_watched(vehicle)


def test_a_fence_is_back_when_the_flight_is_over() -> None:
    vehicle = fenced()
    switch(vehicle, 0.0)
    vehicle.set_mode(6)
    vehicle.run_until(lambda v: not v.armed, 60.0)
    vehicle.run(1.0)
    assert is_watched(vehicle)


def test_a_fence_switched_off_before_the_flight_stays_off_in_it() -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    switch(vehicle, 0.0)
    vehicle.arm()
    vehicle.run(1.0)
    assert not is_watched(vehicle)


@pytest.mark.thorough
def test_a_mission_may_disable_the_geofence_for_some_of_its_items() -> None:
    vehicle = ToyVehicle()
    vehicle.registry.set("GF_MAX_HOR_DIST", 20.0)
    vehicle.run(0.5)
    out = (takeoff(), item(1, 207, param1=0.0), waypoint(2, 40, 0), waypoint(3, 0, 0))
    plan = (*out, item(4, 207, param1=1.0), item(5, 189), item(6, 21, x=NAN, y=NAN, param4=NAN))
    assert vehicle.check_mission(plan) is None
    vehicle.upload(*plan)
    vehicle.run(0.1)
    vehicle.set_mode(4)
    vehicle.arm()
    vehicle.run_until(lambda v: v.position[0] > 25.0)
    vehicle.run(1.0)
    assert not is_watched(vehicle)
    vehicle.run_until(lambda v: 5 in v.reached)
    vehicle.run(1.0)
    assert is_watched(vehicle)
    vehicle.run_until(lambda v: not v.armed)


def test_a_mission_that_comes_to_its_end_outside_with_the_fence_on_is_refused() -> None:
    vehicle = ToyVehicle()
    vehicle.registry.set("GF_MAX_HOR_DIST", 20.0)
    vehicle.run(0.5)
    off, on = item(1, 207, param1=0.0), item(3, 207, param1=1.0)
    plan = (takeoff(), off, waypoint(2, 40, 0), on, waypoint(4, 50, 0))
    rejection = vehicle.check_mission(plan)
    assert rejection is not None
    assert rejection.seq == 4


@pytest.mark.parametrize("value", [2.0, 3.0, -1.0, NAN])
def test_an_item_that_switches_neither_on_nor_off_is_refused(value: float) -> None:
    rejection = check_item(item(1, 207, param1=value), None)
    assert rejection is not None
    assert rejection.result == MissionResult.INVALID_PARAM1
