from collections.abc import Callable

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import Bench, command_long, status
from uav_firmware.modules.navigator.params import NavigatorParams
from uav_firmware.parameters import Registry

STORAGE = 245
ACCEPTED, BUSY, DENIED, FAILED = 0, 1, 2, 4
NAME = "MIS_TAKEOFF_ALT"


def bench_with_a_changed_parameter(save: Callable[[], None]) -> Bench:
    registry = Registry()
    registry.add(NavigatorParams)
    registry.set(NAME, 7.0)
    bench = Bench(registry=registry, save=save)
    bench.topics.vehicle_status.publish(status(armed=False))
    return bench


def result(bench: Bench, *parameters: float) -> int:
    (ack,) = bench.ask(command_long(STORAGE, *parameters), "COMMAND_ACK")
    return int(ack.result)


@pytest.mark.parametrize("action", [2, 4])
def test_a_reset_puts_the_defaults_back_and_stores_them(action: int) -> None:
    saved: list[bool] = []
    bench = bench_with_a_changed_parameter(lambda: saved.append(True))
    assert result(bench, action, -1) == ACCEPTED
    assert bench.registry.get(NAME) == bench.registry.declaration(NAME).default
    assert saved == [True]


@pytest.mark.parametrize(("action", "saves"), [(0, 0), (1, 1)])
def test_reading_and_writing_change_nothing(action: int, saves: int) -> None:
    saved: list[bool] = []
    bench = bench_with_a_changed_parameter(lambda: saved.append(True))
    assert result(bench, action) == ACCEPTED
    assert bench.registry.get(NAME) == 7.0
    assert len(saved) == saves


@pytest.mark.parametrize(
    "parameters", [(3,), (5,), (-1,), (2, 2), (1, 0, 100), (float("nan"),), (float("inf"),)]
)
def test_what_cannot_be_done_is_denied(parameters: tuple[float, ...]) -> None:
    bench = bench_with_a_changed_parameter(lambda: None)
    assert result(bench, *parameters) == DENIED
    assert bench.registry.get(NAME) == 7.0


def test_nothing_is_reset_while_the_motors_may_turn() -> None:
    bench = bench_with_a_changed_parameter(lambda: None)
    bench.topics.vehicle_status.publish(status(armed=True))
    assert result(bench, 2) == BUSY
    assert bench.registry.get(NAME) == 7.0


def test_a_medium_that_refuses_is_a_failure() -> None:
    def refuse() -> None:
        raise OSError(28, "No space left on device")

    assert result(bench_with_a_changed_parameter(refuse), 1) == FAILED
