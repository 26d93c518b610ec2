import math
from collections.abc import Callable

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import MavlinkHarness, command_long, status
from uav_firmware.modules.mavlink.commands.preflight_commands import PowerAction
from uav_firmware.modules.navigator.params import NavigatorParams
from uav_firmware.parameters import Registry

STORAGE = 245
ACCEPTED, BUSY, DENIED, FAILED = 0, 1, 2, 4
NAME = "MIS_TAKEOFF_ALT"


def bench_with_a_changed_parameter(save: Callable[[], None]) -> MavlinkHarness:
    registry = Registry()
    registry.add(NavigatorParams)
    registry.set(NAME, 7.0)
    harness = MavlinkHarness(registry=registry, save=save)
    harness.topics.vehicle_status.publish(status(armed=False))
    return harness


def result(harness: MavlinkHarness, *parameters: float) -> int:
    (ack,) = harness.request(command_long(STORAGE, *parameters), "COMMAND_ACK")
    return int(ack.result)


@pytest.mark.parametrize("action", [2, 4])
def test_a_reset_restores_and_stores_the_defaults(action: int) -> None:
    saved: list[bool] = []
    harness = bench_with_a_changed_parameter(lambda: saved.append(True))
    assert result(harness, action, -1) == ACCEPTED
    assert harness.registry.get(NAME) == harness.registry.declaration(NAME).default
    assert saved == [True]


@pytest.mark.parametrize(("action", "saves"), [(0, 0), (1, 1)])
def test_reading_and_writing_change_nothing(action: int, saves: int) -> None:
    saved: list[bool] = []
    harness = bench_with_a_changed_parameter(lambda: saved.append(True))
    assert result(harness, action) == ACCEPTED
    assert harness.registry.get(NAME) == 7.0
    assert len(saved) == saves


@pytest.mark.parametrize(
    "parameters", [(3,), (5,), (-1,), (2, 2), (1, 0, 100), (float("nan"),), (float("inf"),)]
)
def test_unsupported_storage_actions_are_denied(parameters: tuple[float, ...]) -> None:
    harness = bench_with_a_changed_parameter(lambda: None)
    assert result(harness, *parameters) == DENIED
    assert harness.registry.get(NAME) == 7.0


def test_a_reset_while_armed_is_rejected() -> None:
    harness = bench_with_a_changed_parameter(lambda: None)
    harness.topics.vehicle_status.publish(status(armed=True))
    assert result(harness, 2) == BUSY
    assert harness.registry.get(NAME) == 7.0


def test_a_storage_error_is_a_failure() -> None:
    def refuse() -> None:
        raise OSError(28, "No space left on device")

    assert result(bench_with_a_changed_parameter(refuse), 1) == FAILED


def test_a_repeated_storage_command_is_answered_again_without_another_save() -> None:
    saved: list[bool] = []
    harness = bench_with_a_changed_parameter(lambda: saved.append(True))
    for confirmation in (0, 1):
        command = command_long(STORAGE, 1.0, confirmation=confirmation)
        (ack,) = harness.request(command, "COMMAND_ACK")
        assert ack.result == ACCEPTED
    assert saved == [True]


POWER = 246
ACCEPTED, BUSY, DENIED, UNSUPPORTED = 0, 1, 2, 3


def requested(*parameters: float, armed: bool = False) -> tuple[int, list[PowerAction]]:
    """The answer, and the accepted actions."""
    granted: list[PowerAction] = []
    harness = MavlinkHarness(power=granted.append)
    harness.topics.vehicle_status.publish(status(armed=armed))
    (ack,) = harness.request(command_long(POWER, *parameters), "COMMAND_ACK")
    return ack.result, granted


@pytest.mark.parametrize("action", [PowerAction.REBOOT, PowerAction.SHUTDOWN])
@pytest.mark.parametrize("others", [0.0, None, math.nan])
def test_a_disarmed_vehicle_executes_power_commands(
    action: PowerAction, others: float | None
) -> None:
    rest = [float(action) if others is None else others] * 3
    assert requested(float(action), *rest) == (ACCEPTED, [action])


def test_power_commands_are_rejected_in_flight() -> None:
    assert requested(1.0, armed=True) == (BUSY, [])


@pytest.mark.parametrize(
    "parameters", [(3,), (-1,), (0.5,), (math.nan,), (1, 2), (0, 1), (1, 0, 0, 0, 7)]
)
def test_power_commands_for_single_components_are_denied(parameters: tuple[float, ...]) -> None:
    assert requested(*parameters) == (DENIED, [])


def test_a_request_without_an_action_does_nothing() -> None:
    assert requested(0.0) == (ACCEPTED, [])


def test_power_commands_without_a_handler_are_unsupported() -> None:
    harness = MavlinkHarness()
    harness.topics.vehicle_status.publish(status(armed=False))
    (ack,) = harness.request(command_long(POWER, 1.0), "COMMAND_ACK")
    assert ack.result == UNSUPPORTED
