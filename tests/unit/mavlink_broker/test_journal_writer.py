"""The thread that writes recovery records: the loop does not wait for it, and it retries."""

import logging
import threading
import time
from pathlib import Path

import pytest

from mavlink_broker import journal as journal_module
from mavlink_broker.database import Database
from mavlink_broker.journal import JournalTable, JournalWriter
from mavlink_broker.vehicle.recovery_state import (
    EMPTY_RECORD,
    PendingReturn,
    RecordUpdate,
    RecoveryRecord,
    VehicleIdentity,
)

IDENTITY = VehicleIdentity(1, "")
TIMEOUT_S = 20.0


def journal_in(folder: Path) -> JournalTable:
    return JournalTable(Database(folder))


def record(number: int) -> RecoveryRecord:
    return RecoveryRecord(pending_return=PendingReturn(mission=str(number), reason=""))


class Loop:
    """Waits for the writer, as the broker's loop does."""

    def __init__(self) -> None:
        self._woken = threading.Event()
        self.settled: list[int] = []

    def wake(self) -> None:
        self._woken.set()

    def wait_for(self, writer: JournalWriter, number: int) -> None:
        """Wait until an update is written or refused."""
        end = time.monotonic() + TIMEOUT_S
        while number not in self.settled:
            assert time.monotonic() < end
            self._woken.wait(0.1)
            self._woken.clear()
            self.settled += [settled for _, settled in writer.take_settled()]


def test_a_record_is_on_the_disk_when_it_is_settled(tmp_path: Path) -> None:
    loop, journal = Loop(), journal_in(tmp_path / "broker")
    writer = JournalWriter(journal, loop.wake)
    writer.start()
    writer.put(RecordUpdate(IDENTITY, 1, record(1)))
    loop.wait_for(writer, 1)
    assert journal.read_all() == {IDENTITY: record(1)}
    writer.close()


def test_the_next_run_reads_the_records_of_this_one(tmp_path: Path) -> None:
    database = Database(tmp_path)
    first = JournalWriter(JournalTable(database), lambda: None)
    first.start()
    assert first.recall(IDENTITY) == EMPTY_RECORD
    for number in range(20):
        first.put(RecordUpdate(IDENTITY, number, record(number)))
    first.close()
    database.close()
    second = JournalWriter(journal_in(tmp_path), lambda: None)
    assert second.recall(IDENTITY) == record(19)


def test_a_refusing_disk_is_logged_once_and_retried(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journal_module, "RETRY_AFTER_S", 0.05)
    place = tmp_path / "broker"
    place.write_text("a file where the folder should be")
    loop, journal = Loop(), journal_in(place)
    with caplog.at_level(logging.WARNING):
        writer = JournalWriter(journal, loop.wake)
        writer.start()
        for number in (1, 2, 3):
            writer.put(RecordUpdate(IDENTITY, number, record(number)))
            loop.wait_for(writer, number)
        refusals = [logged for logged in caplog.messages if "no journal is kept" in logged]
        assert len(refusals) == 1
        assert str(place) in refusals[0]
        place.unlink()
        loop.settled.clear()
        loop.wait_for(writer, 3)
        writer.close()
    assert journal.read_all() == {IDENTITY: record(3)}
    assert [
        logged
        for logged in caplog.messages
        if "the broker's journal can be written again" in logged
    ]
