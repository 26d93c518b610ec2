import json
from dataclasses import dataclass

from tests.support.slow_storage import SlowStorage
from uav_firmware.bus import Queue
from uav_firmware.cal.storage import WRITTEN, Storage, Write
from uav_firmware.modules.parameter_storage.module import FILE_NAME, ParameterStorageModule
from uav_firmware.msg.status import ParameterSaveRequest, ParameterSaveResult, StatusText
from uav_firmware.parameters import Registry, param


@dataclass(frozen=True, slots=True, kw_only=True)
class Example:
    gain: float = param("EX_GAIN", 1.0, unit="1", minimum=0.0, maximum=5.0, short="A gain")
    count: int = param("EX_COUNT", 2, unit="1", minimum=0, maximum=9, short="A count")


class Memory:
    """A storage in memory that can be made to fail."""

    def __init__(self, contents: bytes | None = None) -> None:
        self.contents = contents
        self.fails = False
        self.saves = 0

    def load(self, name: str) -> bytes | None:
        assert name == FILE_NAME
        return self.contents

    def save(self, name: str, contents: bytes) -> Write:
        assert name == FILE_NAME
        if self.fails:
            raise OSError(28, "No space left on device")
        self.saves += 1
        self.contents = contents
        return WRITTEN

    def remove(self, name: str) -> Write:
        assert name == FILE_NAME
        self.contents = None
        return WRITTEN


class Vehicle:
    """The module with its registry and its warnings."""

    def __init__(self, memory: Storage) -> None:
        self.registry = Registry()
        self.registry.add(Example)
        self._texts: Queue[StatusText] = Queue()
        self._requests: Queue[ParameterSaveRequest] = Queue()
        self._results: Queue[ParameterSaveResult] = Queue()
        self.module = ParameterStorageModule(
            memory,
            registry=self.registry,
            save_request=self._requests,
            save_result=self._results,
            status_text=self._texts,
            time_us=lambda: 5,
        )

    def request_saves(self, *request_ids: int) -> list[tuple[int, str]]:
        """Request saves; return the id and the fault of each result."""
        for request_id in request_ids:
            self._requests.publish(ParameterSaveRequest(request_id))
        self.module.serve_requests()
        return [(result.request_id, result.fault) for result in self._results.drain()]

    def warnings(self) -> list[str]:
        return [text.text for text in self._texts.drain()]


def test_a_changed_parameter_survives_a_restart() -> None:
    memory = Memory()
    vehicle = Vehicle(memory)
    vehicle.registry.set("EX_GAIN", 2.5)
    vehicle.registry.set("EX_COUNT", 7)
    vehicle.module.update()
    restarted = Vehicle(memory)
    assert restarted.registry.get("EX_GAIN") == 2.5
    assert restarted.registry.get("EX_COUNT") == 7
    assert restarted.warnings() == []


def test_only_changed_values_are_stored() -> None:
    memory = Memory()
    vehicle = Vehicle(memory)
    vehicle.registry.set("EX_COUNT", 7)
    vehicle.module.update()
    assert json.loads(memory.contents or b"") == {"EX_COUNT": 7}


def test_nothing_is_written_without_a_change() -> None:
    memory = Memory(b'{"EX_COUNT": 7}')
    Vehicle(memory).module.update()
    assert memory.saves == 0


def test_full_storage_is_reported_once_and_retried() -> None:
    memory = Memory()
    vehicle = Vehicle(memory)
    vehicle.registry.set("EX_COUNT", 7)
    memory.fails = True
    vehicle.module.update()
    vehicle.module.update()
    assert vehicle.warnings() == ["Parameters not saved: No space left on device"]
    memory.fails = False
    vehicle.module.update()
    assert memory.saves == 1


def test_damaged_contents_leave_defaults_and_are_reported() -> None:
    for contents in (b"{", b"[1]", b"\xff\xfe", b'{"EX_COUNT": "7"}', b'{"EX_COUNT": 99}'):
        vehicle = Vehicle(Memory(contents))
        assert vehicle.registry.get("EX_COUNT") == 2
        assert len(vehicle.warnings()) == 1


def test_one_invalid_value_does_not_affect_the_others() -> None:
    vehicle = Vehicle(Memory(b'{"EX_COUNT": 7, "EX_GAIN": 99.0, "GONE": 1}'))
    assert vehicle.registry.get("EX_COUNT") == 7
    assert vehicle.registry.get("EX_GAIN") == 1.0
    assert len(vehicle.warnings()) == 2


def test_a_requested_save_is_answered_while_the_medium_still_writes() -> None:
    storage = SlowStorage()
    vehicle = Vehicle(storage)
    vehicle.registry.set("EX_COUNT", 7)
    assert vehicle.request_saves(4) == [(4, "")]
    assert storage.waiting == 1
    storage.end()
    assert json.loads(storage.files[FILE_NAME]) == {"EX_COUNT": 7}


def test_a_refused_save_is_the_fault_of_its_request() -> None:
    memory = Memory()
    vehicle = Vehicle(memory)
    vehicle.registry.set("EX_COUNT", 7)
    memory.fails = True
    assert vehicle.request_saves(1) == [(1, "No space left on device")]
    memory.fails = False
    assert vehicle.request_saves(2) == [(2, "")]
    assert json.loads(memory.contents or b"") == {"EX_COUNT": 7}
    assert vehicle.warnings() == []


def test_a_write_that_failed_later_is_the_fault_of_the_next_request() -> None:
    storage = SlowStorage()
    vehicle = Vehicle(storage)
    vehicle.registry.set("EX_COUNT", 7)
    assert vehicle.request_saves(1) == [(1, "")]
    storage.end(full=True)
    assert vehicle.request_saves(2) == [(2, "No space left on device")]


def test_requests_without_a_change_in_between_share_one_write() -> None:
    memory = Memory()
    vehicle = Vehicle(memory)
    vehicle.registry.set("EX_COUNT", 7)
    assert vehicle.request_saves(1, 2, 3) == [(1, ""), (2, ""), (3, "")]
    assert memory.saves == 1


class EndsWhenAwaited(SlowStorage):
    """A storage on which each write ends when its result is awaited."""

    def __init__(self, outcomes: list[bool]) -> None:
        super().__init__()
        self.outcomes = outcomes  # Whether each write fails

    def save(self, name: str, contents: bytes) -> Write:
        return Awaited(self, super().save(name, contents))


class Awaited:
    """One such write."""

    def __init__(self, storage: EndsWhenAwaited, write: Write) -> None:
        self._storage, self._write = storage, write

    def done(self) -> bool:
        return self._write.done()

    def result(self, timeout: float | None = None) -> None:
        if not self._write.done() and self._storage.outcomes:
            self._storage.end(full=self._storage.outcomes.pop(0))
        self._write.result(timeout)


def test_shutdown_retries_a_failed_save() -> None:
    storage = EndsWhenAwaited([True, False])
    vehicle = Vehicle(storage)
    vehicle.registry.set("EX_COUNT", 7)
    vehicle.module.update()
    assert vehicle.module.finish() == ""
    assert json.loads(storage.files[FILE_NAME]) == {"EX_COUNT": 7}


def test_shutdown_saves_changes_made_during_a_write() -> None:
    storage = EndsWhenAwaited([False, False])
    vehicle = Vehicle(storage)
    vehicle.registry.set("EX_COUNT", 7)
    vehicle.module.update()
    vehicle.registry.set("EX_COUNT", 8)
    assert vehicle.module.finish() == ""
    assert json.loads(storage.files[FILE_NAME]) == {"EX_COUNT": 8}


def test_a_last_write_that_fails_or_blocks_is_reported() -> None:
    for outcomes, reason in (
        ([True, True], "No space left on device"),
        ([True], "the storage does not answer"),
        ([], "the storage does not answer"),
    ):
        vehicle = Vehicle(EndsWhenAwaited(outcomes))
        vehicle.registry.set("EX_COUNT", 7)
        vehicle.module.update()
        assert vehicle.module.finish() == f"Parameters not saved: {reason}"
