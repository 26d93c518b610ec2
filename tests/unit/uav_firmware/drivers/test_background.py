"""Writes beside the loop: begun at once, in order, their outcome seen later, bounded."""

import errno
from pathlib import Path
from threading import Event

import pytest

from uav_firmware.cal.storage import WRITTEN, Write
from uav_firmware.drivers import background
from uav_firmware.drivers.background import (
    STORAGE_BACKLOG,
    BackgroundLogs,
    BackgroundStorage,
    MediumTooSlowError,
)
from uav_firmware.drivers.file_storage import FileStorage
from uav_firmware.drivers.log_folder import LogFolder

NOON_US = 1_772_366_400_000_000


class HeldStorage(FileStorage):
    """Files on a medium that does nothing until it may."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.may = Event()
        self.refusal: OSError | None = None

    def save(self, name: str, contents: bytes) -> Write:
        assert self.may.wait(30.0)
        if self.refusal is not None:
            raise self.refusal
        return super().save(name, contents)


def test_a_save_begins_at_once_and_the_last_one_stays(tmp_path: Path) -> None:
    held = HeldStorage(tmp_path)
    storage = BackgroundStorage(held)
    writes = [storage.save("a.json", b"%d" % number) for number in range(10)]
    assert not any(write.done() for write in writes)
    assert not (tmp_path / "a.json").exists()
    held.may.set()
    storage.close()
    assert all(write.done() for write in writes)
    assert FileStorage(tmp_path).load("a.json") == b"9"


def test_a_refusal_is_the_outcome_of_its_own_write(tmp_path: Path) -> None:
    held = HeldStorage(tmp_path)
    held.may.set()
    storage = BackgroundStorage(held)
    storage.save("a.json", b"former")
    storage.load("a.json")
    held.refusal = OSError(errno.ENOSPC, "No space left on device")
    write = storage.save("a.json", b"new")
    storage.close()
    with pytest.raises(OSError, match="No space"):
        write.result()
    assert FileStorage(tmp_path).load("a.json") == b"former"


def test_a_medium_that_hangs_is_not_given_ever_more(tmp_path: Path) -> None:
    held = HeldStorage(tmp_path)
    storage = BackgroundStorage(held)
    for _ in range(STORAGE_BACKLOG):
        storage.save("a.json", b"")
    with pytest.raises(MediumTooSlowError, match="too slow"):
        storage.save("a.json", b"")
    held.may.set()
    storage.close()


class HeldLog:
    """A log file that writes when it may."""

    def __init__(self, may: Event) -> None:
        self._may = may
        self.contents = b""
        self.calls: list[str] = []

    def write(self, chunk: bytes) -> None:
        assert self._may.wait(30.0)
        self.contents += chunk

    def sync(self) -> None:
        self.calls.append("sync")

    def close(self) -> None:
        self.calls.append("close")


class FaultyLog(HeldLog):
    """A log file whose driver has a fault that is no OSError."""

    def write(self, chunk: bytes) -> None:
        super().write(chunk)
        raise ValueError("write to closed file")

    def close(self) -> None:
        super().close()
        raise OSError(errno.EIO, "Input/output error")


class HeldLogs:
    """Makes one such file."""

    def __init__(self) -> None:
        self.may = Event()
        self.file = HeldLog(self.may)

    def free_bytes(self) -> int:
        return 5

    def create(self, _time_utc_us: int) -> HeldLog:
        return self.file


def test_a_log_is_written_in_order_while_nobody_waits() -> None:
    held = HeldLogs()
    logs = BackgroundLogs(held)
    file = logs.create(NOON_US)
    for number in range(5):
        file.write(b"%d" % number)
    file.sync()
    file.close()
    assert held.file.contents == b""
    held.may.set()
    logs.close()
    assert held.file.contents == b"01234"
    assert held.file.calls == ["sync", "close"]


def test_a_log_whose_medium_hangs_ends_instead_of_growing_in_memory() -> None:
    held = HeldLogs()
    logs = BackgroundLogs(held, backlog_bytes=10)
    file = logs.create(NOON_US)
    file.write(b"12345678")
    with pytest.raises(MediumTooSlowError, match="too slow"):
        file.write(b"123")
    held.may.set()
    logs.close()


def test_a_log_that_cannot_be_begun_is_refused_at_its_next_write(tmp_path: Path) -> None:
    (tmp_path / "log").write_text("no folder")
    logs = BackgroundLogs(LogFolder(tmp_path / "log"))
    file = logs.create(NOON_US)
    file.close()
    logs.close()
    with pytest.raises(OSError, match=r"(?i)not a directory|exists"):
        file.write(b"chunk")


def test_any_fault_of_a_log_is_refused_at_its_next_write_and_gives_its_room_back() -> None:
    held = HeldLogs()
    held.file = FaultyLog(held.may)
    held.may.set()
    logs = BackgroundLogs(held, backlog_bytes=10)
    file = logs.create(NOON_US)
    file.write(b"12345678")
    file.close()
    assert logs.close()
    with pytest.raises(OSError, match="ValueError: write to closed file"):
        file.write(b"12345678")
    assert held.file.calls == ["close"]


def test_any_fault_of_a_save_is_an_oserror_and_the_next_save_is_made(tmp_path: Path) -> None:
    held = HeldStorage(tmp_path)
    held.may.set()
    storage = BackgroundStorage(held)
    bad = storage.save("a.json", "text")  # type: ignore[arg-type]  # a fault of the caller
    good = storage.save("a.json", b"new")
    with pytest.raises(OSError, match="TypeError"):
        bad.result(30.0)
    good.result(30.0)
    assert storage.close()


def test_a_medium_that_hangs_does_not_keep_the_program_from_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(background, "CLOSE_S", 0.05)
    held = HeldStorage(tmp_path)
    storage = BackgroundStorage(held)
    storage.save("a.json", b"1")
    assert not storage.close()
    assert storage.thread._thread.daemon
    held.may.set()
    monkeypatch.setattr(background, "CLOSE_S", 30.0)
    assert storage.close()


def test_what_is_stored_at_once_counts_as_written() -> None:
    assert WRITTEN.done()
    WRITTEN.result()
