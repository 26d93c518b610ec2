import pytest

from uav_firmware.modules.mavlink.commands.modes import (
    MODES,
    OFFERED,
    from_custom_mode,
    from_main_and_sub,
    from_standard_mode,
)
from uav_firmware.msg.status import NavigationState


def test_every_navigation_state_has_a_mode_of_its_own() -> None:
    assert set(MODES) == set(NavigationState)
    assert len({mode.custom_mode for mode in MODES.values()}) == len(MODES)


@pytest.mark.parametrize("state", NavigationState)
def test_a_mode_reads_back_from_either_spelling(state: NavigationState) -> None:
    mode = MODES[state]
    assert from_main_and_sub(mode.main, mode.sub) is state
    assert from_custom_mode(mode.custom_mode) is state


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
def test_a_number_that_is_no_mode_gives_none(custom_mode: int) -> None:
    assert from_custom_mode(custom_mode) is None


def test_standard_modes_give_only_what_the_vehicle_flies() -> None:
    flown = {standard: from_standard_mode(standard) for standard in range(12)}
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
