"""The commands that a vehicle in flight must carry out, and PX4's masks of parameters."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mavlink

from tests.conformance.lockstep import Lockstep

pytestmark = pytest.mark.scenario

VEHICLE = 5
NAN = math.nan
ACCEPTED, DENIED = 0, 2
ARM, TAKEOFF, HOLD = 400, 22, 0x03040000
HEIGHT_M = 12.0
PLACE = "place"  # Stands for a place near home in parameters 5 and 6, and a height in 7

ACCEPTED_IN_FLIGHT: list[tuple[int, tuple[float, ...], str]] = [
    (16, (2.0, 1.0, 0.0, NAN), PLACE),
    (17, (), ""),
    (17, (0.0, 0.0, 0.0, NAN), PLACE),
    (19, (3.0,), ""),
    (19, (3.0,), PLACE),
    (22, (0.0, 0.0, 0.0, NAN), PLACE),
    (34, (12.0, 2.0, 0.0, NAN), PLACE),
    (34, (-12.0, NAN, 5.0, math.tau), PLACE),
    (192, (-1.0, 1.0, 0.0, NAN), PLACE),
    (192, (2.0, 1.0, 0.0, 1.0), PLACE),
    (32, (9.0,), ""),
    (32, (0.0,), ""),
    (115, (90.0, 20.0, 1.0, 0.0), ""),
    (178, (1.0, 3.0, -1.0, 0.0), ""),
    (179, (1.0,), ""),
    (193, (0.0,), ""),
    (195, (0.0, 0.0, 0.0, 0.0), PLACE),
    (197, (), ""),
    (176, (29.0, 4.0, 3.0), ""),
    (176, (1.0, 0x03040000), ""),
    (262, (5.0,), ""),  # Standard mode: safe recovery
    (20, (), ""),
    (21, (), ""),
    (400, (1.0,), ""),
    (17, (), ""),
]

SET_AND_NOT_HONOURED = [
    (400, (1.0, 0.0, 1.0)),
    (20, (1.0,)),
    (16, (0.0, 0.0, 1.0)),
    (22, (0.0, 1.0)),
    (176, (1.0, 4.0, 3.0, 1.0)),
    (512, (148.0, 0.0, 0.0, 0.0, 0.0, 0.0, 5.0)),
]


@pytest.fixture(scope="module")
def flying(tmp_path_factory: pytest.TempPathFactory) -> Lockstep:
    return airborne(tmp_path_factory.mktemp("vehicle"))


def airborne(folder: Path) -> Lockstep:
    """A vehicle that holds its position in the air."""
    made = Lockstep(VEHICLE, folder)
    ready = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    made.until(
        lambda m: m.get_type() == "SYS_STATUS" and m.onboard_control_sensors_health & ready,
        60.0,
        "a vehicle that is ready",
    )
    made.until(lambda m: m.get_type() == "HOME_POSITION", 10.0, "home")
    result(made, long(TAKEOFF, (NAN,) * 6 + (home(made)[2] + HEIGHT_M,)))
    assert result(made, long(ARM, (1.0,))) == ACCEPTED
    made.until(lambda m: m.get_type() == "HEARTBEAT" and m.custom_mode == HOLD, 30.0, "hold")
    return made


def home(station: Lockstep) -> tuple[int, int, float]:
    """Latitude and longitude times 1e7, altitude above mean sea level [m]."""
    message = station.newest["HOME_POSITION"]
    return message.latitude, message.longitude, message.altitude / 1e3


def long(number: int, parameters: tuple[float, ...]) -> Any:
    padded = [*parameters, *[0.0] * (7 - len(parameters))]
    return mavlink.MAVLink_command_long_message(VEHICLE, 1, number, 0, *padded)


def both_forms(station: Lockstep, number: int, first: tuple[float, ...], place: str) -> list[Any]:
    """COMMAND_LONG and COMMAND_INT of the same command."""
    latitude, longitude, altitude_m = home(station)
    p = [*first, *[0.0] * (4 - len(first))]
    x, y, z = (latitude + 1000, longitude, altitude_m + HEIGHT_M) if place else (0, 0, 0.0)
    as_int = mavlink.MAVLink_command_int_message(
        VEHICLE, 1, 0 if place else 2, number, 0, 0, *p, x, y, z
    )
    return [long(number, (*p, x / 1e7, y / 1e7, z)), as_int]


def result(station: Lockstep, message: Any) -> int:
    """The one final answer, which must come within a second of vehicle time."""
    station.say(message)
    received = station.run(1.0)
    finals = [
        m.result
        for m in received
        if m.get_type() == "COMMAND_ACK" and m.command == message.command and m.result != 5
    ]
    assert len(finals) == 1, f"command {message.command} was answered {len(finals)} times"
    return int(finals[0])


def test_long_and_int_are_carried_out_alike(flying: Lockstep) -> None:
    for number, first, place in ACCEPTED_IN_FLIGHT:
        for message in both_forms(flying, number, first, place):
            assert result(flying, message) == ACCEPTED, (number, first, message.get_type())


@pytest.mark.parametrize(("number", "parameters"), SET_AND_NOT_HONOURED)
def test_an_unsupported_parameter_value_is_denied(
    flying: Lockstep, number: int, parameters: tuple[float, ...]
) -> None:
    assert result(flying, long(number, parameters)) == DENIED


def test_relative_frames_count_from_home(flying: Lockstep) -> None:
    latitude, longitude, _ = home(flying)
    for frame in (3, 6):
        go_to = mavlink.MAVLink_command_int_message(
            VEHICLE, 1, frame, 192, 0, 0, -1, 1, 0, NAN, latitude, longitude, HEIGHT_M + frame
        )
        assert result(flying, go_to) == ACCEPTED
        flying.until(at_height(HEIGHT_M + frame), 30.0, "the height above home")


def at_height(wanted_m: float) -> Callable[[Any], bool]:
    def check(message: Any) -> bool:
        if message.get_type() != "GLOBAL_POSITION_INT":
            return False
        return bool(abs(message.relative_alt / 1e3 - wanted_m) < 0.7)

    return check


@pytest.mark.parametrize("frame", [1, 10, 11, 21])
def test_other_frames_are_refused_as_such(flying: Lockstep, frame: int) -> None:
    message = mavlink.MAVLink_command_int_message(
        VEHICLE, 1, frame, 192, 0, 0, -1, 1, 0, NAN, 0, 0, 20.0
    )
    assert result(flying, message) == 9
