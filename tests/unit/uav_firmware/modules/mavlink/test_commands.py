import math

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import command_int, command_long
from uav_firmware.modules.mavlink.commands import FORWARDED, RULES, from_int, from_long, refusal
from uav_firmware.modules.mavlink.dialect import mavlink

DENIED = mavlink.MAV_RESULT_DENIED
NAN = math.nan


def judged(number: int, *parameters: float) -> int | None:
    return refusal(from_long(command_long(number, *parameters)))


def test_positions_are_degrees_whichever_message_carried_them() -> None:
    by_float = from_long(command_long(192, -1, 1, 0, NAN, 40.5, -3.25, 700))
    by_integer = from_int(command_int(192, -1, 1, 0, NAN, 405_000_000, -32_500_000, 700))
    assert by_integer is not None
    assert by_float.parameters[4:] == by_integer.parameters[4:] == (40.5, -3.25, 700.0)
    assert by_float.frame == by_integer.frame == 0


@pytest.mark.parametrize(("frame", "datum"), [(0, 0), (5, 0), (3, 3), (6, 3), (2, 0)])
def test_frames_give_the_datum_of_the_altitude(frame: int, datum: int) -> None:
    command = from_int(command_int(192, frame=frame))
    assert command is not None
    assert command.frame == datum


@pytest.mark.parametrize("frame", [1, 4, 7, 8, 9, 10, 11, 12, 20, 21, 255])
def test_frames_that_are_not_flown_in_are_no_command(frame: int) -> None:
    assert from_int(command_int(192, frame=frame)) is None


def test_an_integer_maximum_is_unset() -> None:
    command = from_int(command_int(192, -1, 1, 0, NAN, 0x7FFFFFFF, 0x7FFFFFFF, 700))
    assert command is not None
    assert all(math.isnan(command.parameter(i)) for i in (5, 6))


def test_integers_of_a_command_without_a_position_stay_as_they_are() -> None:
    command = from_int(command_int(400, 1, 0, 0, 0, 3, 4))
    assert command is not None
    assert command.parameters[4:6] == (3.0, 4.0)


@pytest.mark.parametrize("number", RULES)
def test_an_ignored_parameter_that_is_set_is_refused(number: int) -> None:
    for index in set(range(1, 8)) - RULES[number].honoured:
        parameters = [0.0] * 7
        parameters[index - 1] = 1.0
        assert judged(number, *parameters) == DENIED


@pytest.mark.parametrize("number", FORWARDED)
def test_an_infinite_parameter_is_refused(number: int) -> None:
    for index in range(7):
        parameters = [0.0] * 7
        parameters[index] = math.inf
        assert judged(number, *parameters) == DENIED


@pytest.mark.parametrize(
    ("number", "parameters"),
    [
        (400, (1.0,)),
        (400, (0.0, 21196.0)),
        (400, (1.0, NAN, NAN, NAN, NAN, NAN, NAN)),
        (22, (-1.0, 0.0, 0.0, NAN, NAN, NAN, 660.0)),
        (22, (NAN,) * 7),
        (20, (NAN,) * 7),
        (192, (-1.0, 1.0, 0.0, NAN, NAN, NAN, NAN)),
        (178, (1.0, 5.0, -1.0)),
        (193, (0.0,)),
        (224, (-1.0,)),
        (224, (3.0, 1.0, NAN)),
        (300, (0.0, 0.0)),
    ],
)
def test_what_ground_stations_send_is_accepted(number: int, parameters: tuple[float, ...]) -> None:
    assert judged(number, *parameters) is None


@pytest.mark.parametrize(
    ("number", "parameters"),
    [
        (400, (2.0,)),
        (400, (NAN,)),
        (400, (1.0, 5.0)),
        (400, (1.0, 0.0, 1.0)),
        (20, (1.0,)),
        (22, (0.0, 0.0, 0.0, 0.0, 91.0, 0.0, 10.0)),
        (192, (-1.0, 1.0, 0.0, 0.0, 0.0, 180.1, 10.0)),
        (178, (4.0, 5.0)),
        (178, (1.0, NAN)),
        (193, (2.0,)),
        (224, (-2.0,)),
        (224, (0.5,)),
        (224, (NAN,)),
        (224, (0.0, 2.0)),
        (224, (0.0, 0.0, 1.0)),
    ],
)
def test_values_that_cannot_be_meant_are_denied(number: int, parameters: tuple[float, ...]) -> None:
    assert judged(number, *parameters) == DENIED
