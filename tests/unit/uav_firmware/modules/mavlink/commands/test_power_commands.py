import math

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import Bench, command_long, status
from uav_firmware.modules.mavlink.commands.power_commands import PowerAction

POWER = 246
ACCEPTED, BUSY, DENIED, UNSUPPORTED = 0, 1, 2, 3


def asked(*parameters: float, armed: bool = False) -> tuple[int, list[PowerAction]]:
    """The answer, and what was granted."""
    granted: list[PowerAction] = []
    bench = Bench(power=granted.append)
    bench.topics.vehicle_status.publish(status(armed=armed))
    (ack,) = bench.ask(command_long(POWER, *parameters), "COMMAND_ACK")
    return ack.result, granted


@pytest.mark.parametrize("action", [PowerAction.REBOOT, PowerAction.SHUTDOWN])
@pytest.mark.parametrize("others", [0.0, None, math.nan])
def test_a_disarmed_vehicle_obeys(action: PowerAction, others: float | None) -> None:
    rest = [float(action) if others is None else others] * 3
    assert asked(float(action), *rest) == (ACCEPTED, [action])


def test_in_flight_it_does_not() -> None:
    assert asked(1.0, armed=True) == (BUSY, [])


@pytest.mark.parametrize(
    "parameters", [(3,), (-1,), (0.5,), (math.nan,), (1, 2), (0, 1), (1, 0, 0, 0, 7)]
)
def test_what_the_vehicle_is_not_made_of_is_denied(parameters: tuple[float, ...]) -> None:
    assert asked(*parameters) == (DENIED, [])


def test_asking_for_nothing_does_nothing() -> None:
    assert asked(0.0) == (ACCEPTED, [])


def test_where_nobody_can_restart_it_is_unsupported() -> None:
    bench = Bench()
    bench.topics.vehicle_status.publish(status(armed=False))
    (ack,) = bench.ask(command_long(POWER, 1.0), "COMMAND_ACK")
    assert ack.result == UNSUPPORTED
