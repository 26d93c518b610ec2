import math

import pytest

from uav_firmware.modules.mavlink.commands.commands import FRAME_AMSL, Command
from uav_firmware.modules.mavlink.commands.mode_commands import (
    command_for,
    from_do_set_mode,
    from_set_mode,
    from_standard_mode,
)
from uav_firmware.modules.mavlink.commands.modes import MODES
from uav_firmware.msg.status import NavigationState


def written(*parameters: float, number: int = 176) -> Command:
    p1, p2, p3, *_ = (*parameters, 0.0, 0.0, 0.0)
    return Command(number, (p1, p2, p3, 0.0, 0.0, 0.0, 0.0), FRAME_AMSL)


@pytest.mark.parametrize("state", NavigationState)
@pytest.mark.parametrize("flags", [1.0, 29.0, 81.0, 157.0])
def test_every_spelling_of_a_mode_means_the_same(state: NavigationState, flags: float) -> None:
    mode = MODES[state]
    expected = command_for(state)
    assert expected.parameters[:3] == (1.0, mode.main, mode.sub)
    assert from_do_set_mode(written(flags, mode.main, mode.sub)) == expected
    assert from_do_set_mode(written(flags, float(mode.custom_mode))) == expected
    assert from_set_mode(int(flags), mode.custom_mode) == expected


@pytest.mark.parametrize(
    "parameters",
    [
        (0.0, 4.0, 4.0),
        (28.0, 4.0, 4.0),
        (1.0, 4.0, 99.0),
        (1.0, 0.0, 0.0),
        (1.0, 99.0, 0.0),
        (1.0, 4.5, 4.0),
        (1.0, -4.0, 4.0),
        (math.nan, 4.0, 4.0),
        (1.0, math.nan, 4.0),
        (1.0, math.inf, 4.0),
        (1.0, 1e30, 0.0),
        (1.0, float(0x04040000), 4.0),
    ],
)
def test_what_names_no_mode_is_no_command(parameters: tuple[float, ...]) -> None:
    assert from_do_set_mode(written(*parameters)) is None


def test_a_mode_without_a_sub_mode_may_leave_it_unset() -> None:
    assert from_do_set_mode(written(1.0, 3.0, math.nan)) == command_for(NavigationState.POSCTL)


def test_standard_modes_are_those_that_the_vehicle_flies() -> None:
    assert from_standard_mode(written(6.0, number=262)) == command_for(NavigationState.AUTO_MISSION)
    for parameter in (0.0, 3.0, 9.0, 99.0, -1.0, 6.5, math.nan):
        assert from_standard_mode(written(parameter, number=262)) is None
