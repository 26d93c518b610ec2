"""What the vehicle does without a fix, a position, a height or an attitude."""

import math
from collections.abc import Callable

import pytest

from tests.support.toy_vehicle import ToyVehicle, at
from tests.unit.uav_firmware.modules.commander.failsafe.test_machine import (
    LAND,
    MISSION,
    NAN,
    State,
    on_mission,
)
from uav_firmware.msg.status import Command, CommandResult


def test_without_gps_it_holds_and_goes_on_when_the_fix_is_back_in_time() -> None:
    vehicle = on_mission(COM_FAIL_ACT_T=5.0)
    vehicle.fix_type = 1
    vehicle.run(3.0)
    assert vehicle.mode is State.AUTO_LOITER
    vehicle.fix_type = 3
    vehicle.run(1.0)
    assert vehicle.mode is MISSION


def test_without_gps_it_lands_and_no_mode_that_leads_elsewhere_can_be_chosen() -> None:
    vehicle = on_mission(COM_FAIL_ACT_T=5.0)
    vehicle.fix_type, vehicle.dead_reckoning = 1, True
    vehicle.run(2.0)
    for command in (Command.NAV_RETURN_TO_LAUNCH, Command.MISSION_START):
        assert vehicle.send(command) == CommandResult.TEMPORARILY_REJECTED
    vehicle.run(4.0)
    assert vehicle.mode is State.AUTO_LAND


def lose_fix(vehicle: ToyVehicle) -> None:
    vehicle.fix_type, vehicle.dead_reckoning = 1, True


def regain_fix(vehicle: ToyVehicle) -> None:
    vehicle.fix_type, vehicle.dead_reckoning = 3, False


def land_at(vehicle: ToyVehicle, north: float) -> int:
    place = at(north, 0.0)
    return vehicle.send(Command.NAV_LAND, 0.0, 0.0, 0.0, NAN, place["x"], place["y"], NAN)


ELSEWHERE = {
    Command.DO_REPOSITION: (-1.0, 1.0, 0.0, NAN),
    Command.NAV_WAYPOINT: (0.0, 2.0, 0.0, NAN),
    Command.NAV_LOITER_UNLIM: (0.0, 0.0, 0.0, NAN),
    Command.NAV_LOITER_TIME: (10.0,),
    Command.NAV_LAND: (0.0, 0.0, 0.0, NAN),
    Command.DO_ORBIT: (20.0, 5.0, NAN, NAN),
    Command.NAV_TAKEOFF: (0.0, 0.0, 0.0, NAN),
}


@pytest.mark.parametrize("reckoning", [True, False])
def test_without_a_fix_no_command_leads_elsewhere_or_overrides_the_landing(
    *, reckoning: bool
) -> None:
    """Also before the estimator has noticed that the fixes are no longer good."""
    vehicle = on_mission(COM_FAIL_ACT_T=3.0)
    lose_fix(vehicle)
    vehicle.dead_reckoning = reckoning
    vehicle.run(1.5)
    place = at(200.0, 0.0)
    for command, given in ELSEWHERE.items():
        vehicle.texts.clear()
        params = (*given, *(0.0,) * (4 - len(given)))
        result = vehicle.send(command, *params, place["x"], place["y"], 660.0)
        assert result == CommandResult.TEMPORARILY_REJECTED, command
        assert any("no GPS fix" in text for text in vehicle.texts), command
    vehicle.run(4.0)
    assert vehicle.mode is LAND
    assert vehicle.position[0] < 40.0


HERE: dict[str, tuple[Command, tuple[float, ...]]] = {
    "hold": (Command.NAV_LOITER_UNLIM, ()),
    "hold for a time": (Command.NAV_LOITER_TIME, (30.0,)),
    "hold as a mode": (Command.DO_SET_MODE, (1.0, 4.0, 3.0)),
    "pause": (Command.DO_PAUSE_CONTINUE, (0.0,)),
    "climb": (Command.DO_REPOSITION, (-1.0, 1.0, 0.0, NAN, NAN, NAN, 690.0)),
}


@pytest.mark.parametrize("landing", [False, True])
def test_without_a_fix_no_hold_or_climb_puts_off_the_landing(*, landing: bool) -> None:
    vehicle = on_mission(COM_FAIL_ACT_T=3.0)
    lose_fix(vehicle)
    vehicle.run(4.5 if landing else 1.5)
    for order, (command, params) in HERE.items():
        vehicle.texts.clear()
        assert vehicle.send(command, *params) == CommandResult.TEMPORARILY_REJECTED, order
        assert any("no GPS fix" in text for text in vehicle.texts), order
    vehicle.run(3.0)
    assert vehicle.mode is LAND


def test_without_a_fix_an_operator_may_order_the_landing_at_once() -> None:
    vehicle = on_mission(COM_FAIL_ACT_T=20.0)
    lose_fix(vehicle)
    vehicle.run(1.5)
    assert vehicle.send(Command.NAV_LAND) == CommandResult.ACCEPTED
    assert vehicle.mode is LAND


@pytest.mark.first_case
@pytest.mark.parametrize("loss", [lose_fix, lambda v: setattr(v, "position_valid", False)])
def test_a_landing_in_transit_lands_here_once_the_fix_is_lost(
    loss: Callable[[ToyVehicle], None],
) -> None:
    vehicle = on_mission()
    assert land_at(vehicle, 120.0) == CommandResult.ACCEPTED
    vehicle.run(2.0)
    begun = vehicle.position[0]
    loss(vehicle)
    vehicle.run(4.0)
    assert math.hypot(*vehicle.velocity[:2]) < 0.1
    vehicle.run_until(lambda v: not v.armed, 60.0)
    assert vehicle.position[0] < begun + 20.0
    assert any("landing here" in text for text in vehicle.texts)


def test_the_place_of_a_landing_can_be_ordered_again_when_the_fix_is_back() -> None:
    vehicle = on_mission()
    land_at(vehicle, 120.0)
    vehicle.run(1.0)
    lose_fix(vehicle)
    vehicle.run(2.0)
    assert any("GPS lost" in text and "LAND" in text for text in vehicle.texts)
    regain_fix(vehicle)
    vehicle.run(1.0)
    assert math.hypot(*vehicle.velocity[:2]) < 0.1
    assert land_at(vehicle, 120.0) == CommandResult.ACCEPTED
    vehicle.run_until(lambda v: not v.armed, 120.0)
    assert abs(vehicle.position[0] - 120.0) < 2.0


def lose_attitude(vehicle: ToyVehicle) -> None:
    vehicle.aligned = False


def lose_altitude(vehicle: ToyVehicle) -> None:
    vehicle.altitude_valid = False


def lose_position(vehicle: ToyVehicle) -> None:
    vehicle.position_valid = False


@pytest.mark.parametrize("loss", [lose_attitude, lose_altitude, lose_position])
def test_without_an_estimate_the_vehicle_descends_at_once(
    loss: Callable[[ToyVehicle], None],
) -> None:
    vehicle = on_mission(COM_FAIL_ACT_T=20.0)
    loss(vehicle)
    vehicle.run(1.2)
    assert vehicle.mode is LAND


def test_modes_that_need_a_position_are_refused_without_one() -> None:
    vehicle = on_mission()
    vehicle.set_mode(6)
    vehicle.position_valid = False
    vehicle.run(0.1)
    for sub_mode in (2, 3, 4, 5):
        vehicle.texts.clear()
        assert vehicle.set_mode(sub_mode) == 1, sub_mode
        assert vehicle.mode is LAND, sub_mode
        assert any("Position not estimated" in text for text in vehicle.texts), sub_mode
