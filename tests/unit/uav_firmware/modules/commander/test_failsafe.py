"""Failsafes: which action a cause takes, that the worst wins, and how a cause clears."""

from itertools import product

import pytest

from tests.support.toy_vehicle import ToyVehicle, takeoff, waypoint
from uav_firmware.modules.commander.failsafe import Action, Cause, action_of
from uav_firmware.modules.commander.params import CommanderParams
from uav_firmware.msg.status import Command, NavigationState


def on_mission() -> ToyVehicle:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    vehicle.upload(takeoff(), waypoint(1, 200, 0))
    vehicle.run(0.1)
    vehicle.set_mode(4)
    vehicle.arm()
    vehicle.run_until(lambda v: v.position[0] > 20.0)
    return vehicle


@pytest.mark.parametrize(
    ("remaining", "mode"),
    [
        (0.20, NavigationState.AUTO_MISSION),
        (0.12, NavigationState.AUTO_MISSION),
        (0.06, NavigationState.AUTO_RTL),
        (0.04, NavigationState.AUTO_LAND),
    ],
)
def test_the_emptier_the_battery_the_stronger_the_action(
    remaining: float, mode: NavigationState
) -> None:
    vehicle = on_mission()
    vehicle.battery = remaining
    vehicle.run(0.5)
    assert vehicle.mode is mode
    warned = any("Battery low" in text for text in vehicle.texts)
    assert warned == (remaining < 0.15)
    assert vehicle.status.value is not None
    assert vehicle.status.value.failsafe == (mode is not NavigationState.AUTO_MISSION)


def test_a_critical_battery_brings_the_vehicle_home() -> None:
    vehicle = on_mission()
    vehicle.battery = 0.06
    vehicle.run_until(lambda v: not v.armed, 200.0)
    assert abs(vehicle.position[0]) < 0.3


def test_a_battery_found_critical_on_the_ground_acts_after_the_take_off() -> None:
    vehicle = ToyVehicle(battery=0.06)
    vehicle.run(0.5)
    vehicle.upload(takeoff(), waypoint(1, 200, 0))
    vehicle.run(0.1)
    vehicle.set_mode(4)
    assert vehicle.send(Command.COMPONENT_ARM_DISARM, 1.0, 21196.0) == 0
    vehicle.run_until(lambda v: v.mode is NavigationState.AUTO_RTL, 10.0)


def test_an_emergency_lands_even_on_the_way_home() -> None:
    vehicle = on_mission()
    vehicle.battery = 0.06
    vehicle.run(2.0)
    vehicle.battery = 0.04
    vehicle.run_until(lambda v: not v.armed, 60.0)
    assert vehicle.position[0] > 5.0


def test_a_weaker_cause_does_not_undo_a_stronger_action() -> None:
    vehicle = on_mission()
    vehicle.set_mode(6)
    vehicle.battery = 0.06
    vehicle.run(1.0)
    assert vehicle.mode is NavigationState.AUTO_LAND
    assert vehicle.status.value is not None
    assert not vehicle.status.value.failsafe


def test_the_operator_may_overrule_and_a_cause_does_not_fire_twice() -> None:
    vehicle = on_mission()
    vehicle.battery = 0.06
    vehicle.run(1.0)
    assert vehicle.set_mode(3) == 0
    modes = []
    # Within the hysteresis, below again, cleared, below once more.
    for remaining in (0.075, 0.06, 0.5, 0.06):
        vehicle.battery = remaining
        vehicle.run(0.5)
        modes.append(vehicle.mode)
    assert modes == [NavigationState.AUTO_LOITER] * 3 + [NavigationState.AUTO_RTL]


def test_a_short_loss_of_position_changes_nothing() -> None:
    vehicle = on_mission()
    vehicle.position_valid = False
    vehicle.run(0.6)
    vehicle.position_valid = True
    vehicle.run(2.0)
    assert vehicle.mode is NavigationState.AUTO_MISSION


def test_return_without_a_position_becomes_a_landing() -> None:
    vehicle = on_mission()
    vehicle.position_valid = False
    vehicle.battery = 0.06
    vehicle.run(0.2)
    assert vehicle.mode is NavigationState.AUTO_LAND


@pytest.mark.parametrize(
    ("setting", "mode"),
    [
        (0, NavigationState.AUTO_MISSION),
        (1, NavigationState.AUTO_LOITER),
        (2, NavigationState.AUTO_RTL),
        (3, NavigationState.AUTO_LAND),
    ],
)
def test_a_lost_link_does_what_the_parameter_says(setting: int, mode: NavigationState) -> None:
    vehicle = on_mission()
    vehicle.registry.set("NAV_DLL_ACT", setting)
    for _ in range(5):
        vehicle.heartbeat.publish(vehicle.now_us)
        vehicle.run(1.0)
    assert vehicle.mode is NavigationState.AUTO_MISSION
    vehicle.run(11.0)
    assert vehicle.mode is mode


def test_every_cause_has_an_action_for_every_setting() -> None:
    for cause, setting in product(Cause, range(4)):
        assert action_of(cause, CommanderParams(link_loss_action=setting)) in Action


@pytest.mark.parametrize("sub_mode", [2, 3, 4, 5])
def test_modes_that_need_a_position_are_refused_without_one(sub_mode: int) -> None:
    vehicle = on_mission()
    vehicle.set_mode(6)
    vehicle.position_valid = False
    vehicle.run(0.1)
    assert vehicle.set_mode(sub_mode) == 1
    assert vehicle.mode is NavigationState.AUTO_LAND
    assert any("Position not estimated" in text for text in vehicle.texts)


def test_a_link_that_was_never_there_cannot_be_lost() -> None:
    vehicle = on_mission()
    vehicle.registry.set("NAV_DLL_ACT", 3)
    vehicle.run(11.0)
    assert vehicle.mode is NavigationState.AUTO_MISSION
