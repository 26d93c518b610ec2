import itertools
import math

import pytest

from tests.support.cases import failures
from uav_firmware.modules.mavlink.commands.commands import FRAME_AMSL, Command
from uav_firmware.modules.mavlink.commands.modes import (
    MODES,
    OFFERED,
    command_for,
    command_from_do_set_mode,
    command_from_set_mode,
    command_from_standard_mode,
    state_from_custom_mode,
    state_from_main_and_sub,
    state_from_standard_mode,
)
from uav_firmware.msg.status import NavigationState


def test_every_navigation_state_has_its_own_mode() -> None:
    assert set(MODES) == set(NavigationState)
    assert len({mode.custom_mode for mode in MODES.values()}) == len(MODES)


@pytest.mark.parametrize("state", NavigationState)
def test_modes_are_read_from_both_encodings(state: NavigationState) -> None:
    mode = MODES[state]
    assert state_from_main_and_sub(mode.main, mode.sub) is state
    assert state_from_custom_mode(mode.custom_mode) is state


@pytest.mark.parametrize(
    ("state", "custom_mode"),
    [
        (NavigationState.MANUAL, 0x00010000),
        (NavigationState.ALTCTL, 0x00020000),
        (NavigationState.POSCTL, 0x00030000),
        (NavigationState.ACRO, 0x00050000),
        (NavigationState.OFFBOARD, 0x00060000),
        (NavigationState.STAB, 0x00070000),
        (NavigationState.ORBIT, 0x01030000),
        (NavigationState.AUTO_TAKEOFF, 0x02040000),
        (NavigationState.AUTO_LOITER, 0x03040000),
        (NavigationState.AUTO_MISSION, 0x04040000),
        (NavigationState.AUTO_RTL, 0x05040000),
        (NavigationState.AUTO_LAND, 0x06040000),
        (NavigationState.AUTO_FOLLOW_TARGET, 0x08040000),
        (NavigationState.AUTO_PRECLAND, 0x09040000),
    ],
)
def test_the_numbers_are_those_that_ground_stations_know(
    state: NavigationState, custom_mode: int
) -> None:
    assert MODES[state].custom_mode == custom_mode


@pytest.mark.parametrize("custom_mode", [0, 1, 0x04040001, 0x63040000, 0x00630000])
def test_an_invalid_custom_mode_is_none(custom_mode: int) -> None:
    assert state_from_custom_mode(custom_mode) is None


def test_standard_modes_give_only_what_the_vehicle_flies() -> None:
    flown = {standard: state_from_standard_mode(standard) for standard in range(12)}
    assert {s: state for s, state in flown.items() if state is not None} == {
        1: NavigationState.POSCTL,
        2: NavigationState.ORBIT,
        4: NavigationState.ALTCTL,
        5: NavigationState.AUTO_RTL,
        6: NavigationState.AUTO_MISSION,
        7: NavigationState.AUTO_LAND,
        8: NavigationState.AUTO_TAKEOFF,
    }
    assert set(filter(None, flown.values())) <= set(OFFERED)


def written(*parameters: float, number: int = 176) -> Command:
    p1, p2, p3, *_ = (*parameters, 0.0, 0.0, 0.0)
    return Command(number, (p1, p2, p3, 0.0, 0.0, 0.0, 0.0), FRAME_AMSL)


def check_encodings(state: NavigationState, flags: float) -> None:
    mode = MODES[state]
    expected = command_for(state)
    assert expected.parameters[:3] == (1.0, mode.main, mode.sub)
    assert command_from_do_set_mode(written(flags, mode.main, mode.sub)) == expected
    assert command_from_do_set_mode(written(flags, float(mode.custom_mode))) == expected
    assert command_from_set_mode(int(flags), mode.custom_mode) == expected


def test_every_encoding_of_a_mode_gives_the_same_command() -> None:
    cases = itertools.product(NavigationState, [1.0, 29.0, 81.0, 157.0])
    assert failures(check_encodings, cases) == []


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ((0.0, 4.0, 4.0), "parameter 1 is 0, without the flag of a custom mode (1)"),
        ((28.0, 4.0, 4.0), "parameter 1 is 28, without the flag of a custom mode (1)"),
        ((1.0, 4.0, 99.0), "there is no mode 4/99"),
        ((1.0, 0.0, 0.0), "there is no mode 0/0"),
        ((1.0, 99.0, 0.0), "there is no mode 99/0"),
        ((1.0, 4.5, 4.0), "there is no mode 4.5/4"),
        ((1.0, -4.0, 4.0), "there is no mode -4/4"),
        ((math.nan, 4.0, 4.0), "parameter 1 is nan, without the flag of a custom mode (1)"),
        ((1.0, math.nan, 4.0), "there is no mode nan/4"),
        ((1.0, math.inf, 4.0), "there is no mode inf/4"),
        ((1.0, 1e30, 0.0), "there is no mode 1e+30/0"),
        ((1.0, float(0x04040000), 4.0), "there is no mode 6.7371e+07/4"),
    ],
)
def test_a_command_without_a_mode_has_the_reason(
    parameters: tuple[float, ...], reason: str
) -> None:
    assert command_from_do_set_mode(written(*parameters)) == reason


def test_a_mode_without_a_sub_mode_may_leave_it_unset() -> None:
    assert command_from_do_set_mode(written(1.0, 3.0, math.nan)) == command_for(
        NavigationState.POSCTL
    )


def test_standard_modes_are_those_that_the_vehicle_flies() -> None:
    assert command_from_standard_mode(written(6.0, number=262)) == command_for(
        NavigationState.AUTO_MISSION
    )
    for parameter in (0.0, 3.0, 9.0, 99.0, -1.0, 6.5, math.nan):
        reason = f"the vehicle has no standard mode {parameter:g}"
        assert command_from_standard_mode(written(parameter, number=262)) == reason
