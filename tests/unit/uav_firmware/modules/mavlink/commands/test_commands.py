import math

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import command_int, command_long
from uav_firmware.modules.mavlink.commands.commands import (
    FORWARDED,
    HANDLED_HERE,
    POSITIONAL,
    from_int,
    from_long,
    ignored_parameter,
)

NAN = math.nan


def test_positions_are_degrees_whichever_message_carried_them() -> None:
    by_float = from_long(command_long(192, -1, 1, 0, NAN, 40.5, -3.25, 700))
    by_integer = from_int(command_int(192, -1, 1, 0, NAN, 405_000_000, -32_500_000, 700))
    assert by_integer is not None
    assert by_float.parameters[4:] == by_integer.parameters[4:] == (40.5, -3.25, 700.0)
    assert by_float.frame == by_integer.frame == 0


@pytest.mark.parametrize(("frame", "datum"), [(0, 0), (5, 0), (3, 3), (6, 3), (2, 0)])
def test_frames_define_the_datum_of_the_altitude(frame: int, datum: int) -> None:
    command = from_int(command_int(192, frame=frame))
    assert command is not None
    assert command.frame == datum


@pytest.mark.parametrize("number", [34, 179])
@pytest.mark.parametrize(("frame", "kept"), [(0, 0), (5, 0), (3, 3), (6, 6)])
def test_orbit_and_set_home_keep_their_frame(number: int, frame: int, kept: int) -> None:
    command = from_int(command_int(number, frame=frame))
    assert command is not None
    assert command.frame == kept


@pytest.mark.parametrize("frame", [1, 4, 7, 8, 9, 10, 11, 12, 20, 21, 255])
def test_commands_in_unsupported_frames_are_none(frame: int) -> None:
    assert from_int(command_int(192, frame=frame)) is None


def test_an_integer_maximum_is_unset() -> None:
    command = from_int(command_int(192, -1, 1, 0, NAN, 0x7FFFFFFF, 0x7FFFFFFF, 700))
    assert command is not None
    assert all(math.isnan(command.parameter(i)) for i in (5, 6))


def test_integers_of_a_command_without_a_position_are_not_scaled() -> None:
    command = from_int(command_int(400, 1, 0, 0, 0, 3, 4))
    assert command is not None
    assert command.parameters[4:6] == (3.0, 4.0)


@pytest.mark.parametrize("number", HANDLED_HERE)
def test_a_set_parameter_without_effect_is_detected(number: int) -> None:
    for index in set(range(1, 8)) - HANDLED_HERE[number]:
        for value in (1.0, -1.0, math.inf):
            parameters = [0.0] * 7
            parameters[index - 1] = value
            assert ignored_parameter(from_long(command_long(number, *parameters))) == index
        parameters[index - 1] = NAN
        assert ignored_parameter(from_long(command_long(number, *parameters))) is None


def test_parameters_of_forwarded_commands_are_not_checked_here() -> None:
    for number in FORWARDED:
        assert ignored_parameter(from_long(command_long(number, *[9.0] * 7))) is None


def test_no_command_is_both_forwarded_and_answered_here() -> None:
    assert not FORWARDED & HANDLED_HERE.keys()
    assert POSITIONAL <= FORWARDED
