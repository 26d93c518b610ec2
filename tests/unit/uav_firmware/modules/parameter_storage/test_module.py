import json
from dataclasses import dataclass

from tests.support.slow_storage import SlowStorage
from uav_firmware.bus import Queue
from uav_firmware.cal.storage import WRITTEN, Storage, Write
from uav_firmware.modules.parameter_storage.module import FILE_NAME, ParameterStorageModule
from uav_firmware.msg.status import StatusText
from uav_firmware.parameters import Registry, param


@dataclass(frozen=True, slots=True, kw_only=True)
class Example:
    gain: float = param("EX_GAIN", 1.0, unit="1", minimum=0.0, maximum=5.0, short="A gain")
    count: int = param("EX_COUNT", 2, unit="1", minimum=0, maximum=9, short="A count")


class Memory:
    """A storage that can be told to refuse."""

    def __init__(self, contents: bytes | None = None) -> None:
        self.contents = contents
        self.refuses = False
        self.saves = 0

    def load(self, name: str) -> bytes | None:
        assert name == FILE_NAME
        return self.contents

    def save(self, name: str, contents: bytes) -> Write:
        assert name == FILE_NAME
        if self.refuses:
            raise OSError(28, "No space left on device")
        self.saves += 1
        self.contents = contents
        return WRITTEN

    def remove(self, name: str) -> Write:
        assert name == FILE_NAME
        self.contents = None
        return WRITTEN


class Vehicle:
    """The module with its registry and what it says."""

    def __init__(self, memory: Storage) -> None:
        self.registry = Registry()
        self.registry.add(Example)
        self._texts: Queue[StatusText] = Queue()
        self.module = ParameterStorageModule(
            memory, registry=self.registry, status_text=self._texts, time_us=lambda: 5
        )

    def says(self) -> list[str]:
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
    assert restarted.says() == []


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


def test_a_full_medium_is_said_once_and_tried_again() -> None:
    memory = Memory()
    vehicle = Vehicle(memory)
    vehicle.registry.set("EX_COUNT", 7)
    memory.refuses = True
    vehicle.module.update()
    vehicle.module.update()
    assert vehicle.says() == ["Parameters not saved: No space left on device"]
    memory.refuses = False
    vehicle.module.update()
    assert memory.saves == 1


def test_broken_contents_leave_the_defaults_and_are_said() -> None:
    for contents in (b"{", b"[1]", b"\xff\xfe", b'{"EX_COUNT": "7"}', b'{"EX_COUNT": 99}'):
        vehicle = Vehicle(Memory(contents))
        assert vehicle.registry.get("EX_COUNT") == 2
        assert len(vehicle.says()) == 1


def test_one_bad_value_does_not_spoil_the_others() -> None:
    vehicle = Vehicle(Memory(b'{"EX_COUNT": 7, "EX_GAIN": 99.0, "GONE": 1}'))
    assert vehicle.registry.get("EX_COUNT") == 7
    assert vehicle.registry.get("EX_GAIN") == 1.0
    assert len(vehicle.says()) == 2


class EndsWhenAwaited(SlowStorage):
    """A medium on which each write ends when somebody waits for it."""

    def __init__(self, outcomes: list[bool]) -> None:
        super().__init__()
        self.outcomes = outcomes  # Whether it refuses, write by write

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


def test_switching_off_saves_again_what_a_write_before_has_failed_to() -> None:
    storage = EndsWhenAwaited([True, False])
    vehicle = Vehicle(storage)
    vehicle.registry.set("EX_COUNT", 7)
    vehicle.module.update()
    assert vehicle.module.finish() == ""
    assert json.loads(storage.files[FILE_NAME]) == {"EX_COUNT": 7}


def test_switching_off_saves_what_changed_behind_a_write() -> None:
    storage = EndsWhenAwaited([False, False])
    vehicle = Vehicle(storage)
    vehicle.registry.set("EX_COUNT", 7)
    vehicle.module.update()
    vehicle.registry.set("EX_COUNT", 8)
    assert vehicle.module.finish() == ""
    assert json.loads(storage.files[FILE_NAME]) == {"EX_COUNT": 8}


def test_a_last_write_that_fails_or_hangs_is_said() -> None:
    for outcomes, reason in (
        ([True, True], "No space left on device"),
        ([True], "the medium does not answer"),
        ([], "the medium does not answer"),
    ):
        vehicle = Vehicle(EndsWhenAwaited(outcomes))
        vehicle.registry.set("EX_COUNT", 7)
        vehicle.module.update()
        assert vehicle.module.finish() == f"Parameters not saved: {reason}"
