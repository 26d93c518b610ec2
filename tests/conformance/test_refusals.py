"""Every command that the vehicle refuses has one STATUSTEXT with its name and the reason.

Every implemented command, with wild parameters, as COMMAND_LONG and as COMMAND_INT, to a whole
vehicle on the ground and in the air. A command or message that is not there is UNSUPPORTED, and a
frame that is not there has a result of its own; these need no text.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any, Final

import pytest
from pymavlink.dialects.v20 import development as mavlink

from tests.conformance.lockstep import Lockstep
from tests.conformance.test_command_matrix import VEHICLE, airborne, long
from tests.support.ground_station import whole_texts
from uav_firmware.modules.mavlink.commands.commands import KNOWN

pytestmark = pytest.mark.scenario

NAN, INF = math.nan, math.inf
REFUSED: Final = {
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
    mavlink.MAV_RESULT_DENIED,
    mavlink.MAV_RESULT_FAILED,
}
ENDS_THE_FLIGHT: Final = {mavlink.MAV_CMD_DO_FLIGHTTERMINATION}
MOVES: Final = {
    mavlink.MAV_CMD_NAV_LAND,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
}
"""Accepted with some of these parameters, they end the flight."""
WILD: Final = (NAN, INF, -INF, 0.0, 1.0, -1.0, 0.5, 255.0, 65_535.0, 1e9, -1e9, 1e30)
SETS: Final = (NAN, INF, -INF, 1e30, -1.0, 1.0)
INT32_UNSET: Final = 0x7FFFFFFF
LATEST_S: Final = 2.5
"""A command without an answer of its module has failed by then."""
PROGRESS: Final = 5


def wild_parameters(random: Random) -> Iterator[tuple[float, ...]]:
    for value in SETS:
        yield (value,) * 7
    for _ in range(3):
        yield tuple(random.choice(WILD) for _ in range(7))


def as_int(number: int, parameters: tuple[float, ...]) -> Any:
    x, y = (
        int(value) if math.isfinite(value) and abs(value) < 2**31 else INT32_UNSET
        for value in parameters[4:6]
    )
    return mavlink.MAVLink_command_int_message(
        VEHICLE, 1, 0, number, 0, 0, *parameters[:4], x, y, parameters[6]
    )


def answered(station: Lockstep, message: Any) -> tuple[int, list[str]]:
    """The final answer to a command, and all texts that came with it."""
    station.say(message)
    received: list[Any] = []
    latest_s = station.now_s + LATEST_S

    def final() -> list[int]:
        acks = [m for m in received if m.get_type() == "COMMAND_ACK"]
        return [a.result for a in acks if a.command == message.command and a.result != PROGRESS]

    while not final():
        assert station.now_s < latest_s, f"command {message.command} has no answer"
        received += station.step()
    received += station.run(0.1)
    (result,) = final()
    return result, whole_texts(received)


def unexplained(station: Lockstep, numbers: set[int], seed: int) -> tuple[list[str], int]:
    """Refusals without exactly one text that names command and reason; the number of refusals."""
    faults, refusals, random = [], 0, Random(seed)
    for number in sorted(numbers):
        name = mavlink.enums["MAV_CMD"][number].name.removeprefix("MAV_CMD_")
        for parameters in wild_parameters(random):
            for message in (long(number, parameters), as_int(number, parameters)):
                result, texts = answered(station, message)
                reasons = [t for t in texts if t.startswith(f"{name} ") and len(t) > len(name) + 12]
                refusals += result in REFUSED
                if len(reasons) != (result in REFUSED):
                    faults.append(f"{message}: {result}, {texts}")
    return faults, refusals


def test_every_refusal_in_the_air_has_one_reason(tmp_path: Path) -> None:
    flying = airborne(tmp_path)
    faults, refusals = unexplained(flying, set(KNOWN) - ENDS_THE_FLIGHT - MOVES, seed=1)
    assert refusals > len(KNOWN)
    assert faults == []


def test_every_refusal_on_the_ground_has_one_reason(tmp_path: Path) -> None:
    standing = Lockstep(VEHICLE, tmp_path)
    standing.until(lambda m: m.get_type() == "HOME_POSITION", 60.0, "home")
    faults, refusals = unexplained(standing, set(KNOWN) - ENDS_THE_FLIGHT, seed=2)
    assert refusals > len(KNOWN)
    assert faults == []


def test_a_bound_that_is_not_allowed_itself_is_not_named_as_allowed(tmp_path: Path) -> None:
    standing = Lockstep(VEHICLE, tmp_path)
    result, texts = answered(standing, long(34, (10.0, 0.0, 0.0, 0.0, NAN, NAN, NAN)))
    assert result == mavlink.MAV_RESULT_DENIED
    speed = "parameter 2: a speed of 0 m/s is not above 0, up to 10 m/s"
    assert texts == [f"DO_ORBIT denied: {speed}"]
