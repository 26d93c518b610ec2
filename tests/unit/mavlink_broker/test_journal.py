"""Recovery records in the broker's database: a record is there as a whole, or the old one is."""

import logging
import sqlite3
from pathlib import Path

import pytest

from mavlink_broker import database as database_module
from mavlink_broker.database import DATABASE_FILE, Database, read_rows
from mavlink_broker.journal import JournalTable, encode_record
from mavlink_broker.microservices.config_overrides import OverriddenParameter
from mavlink_broker.vehicle.recovery_state import (
    EMPTY_RECORD,
    PendingReturn,
    RecoveryRecord,
    VehicleIdentity,
)

ONE, OTHER = VehicleIdentity(1, ""), VehicleIdentity(1, "00ff")
OLD = RecoveryRecord(borrowed={"CIRCLE_RATE": OverriddenParameter(20.0, (5.0,))})
NEW = RecoveryRecord(pending_return=PendingReturn(mission="1/plan", reason="GPS"))


def test_each_vehicle_has_a_record_of_its_own(tmp_path: Path) -> None:
    journal = JournalTable(Database(tmp_path / "broker"))
    journal.write(ONE, OLD)
    journal.write(OTHER, NEW)
    assert journal.read_all() == {ONE: OLD, OTHER: NEW}
    journal.write(ONE, NEW)
    assert journal.read_all() == {ONE: NEW, OTHER: NEW}


def test_an_empty_record_is_removed(tmp_path: Path) -> None:
    journal = JournalTable(Database(tmp_path))
    journal.write(ONE, OLD)
    journal.write(ONE, EMPTY_RECORD)
    assert journal.read_all() == {}
    assert read_rows(tmp_path, "SELECT * FROM records") == []


def test_a_refused_write_leaves_the_old_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database_module, "BUSY_TIMEOUT_S", 0.0)
    journal = JournalTable(Database(tmp_path))
    journal.write(ONE, OLD)
    other = sqlite3.connect(tmp_path / DATABASE_FILE, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    with pytest.raises(OSError, match="locked"):
        journal.write(ONE, NEW)
    assert journal.read_all() == {ONE: OLD}
    other.close()
    journal.write(ONE, NEW)
    assert journal.read_all() == {ONE: NEW}


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "does not begin like a recovery record"),
        (encode_record(ONE, OLD)[:-7], "checksum"),
        (encode_record(VehicleIdentity(2, ""), OLD), "it is the record of system 2"),
    ],
)
def test_an_invalid_record_is_set_aside_and_logged_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, content: bytes, reason: str
) -> None:
    database = Database(tmp_path)
    journal = JournalTable(database)
    journal.write(OTHER, NEW)
    with database.change() as rows:
        rows.execute("INSERT INTO records VALUES (1, '', ?)", (content,))
    with caplog.at_level(logging.WARNING):
        assert journal.read_all() == {OTHER: NEW}
    (logged,) = caplog.messages
    assert "records is set aside: system 1" in logged
    assert reason in logged
    assert read_rows(tmp_path, "SELECT source, data FROM damaged") == [("records", content)]
    caplog.clear()
    assert journal.read_all() == {OTHER: NEW}
    assert caplog.messages == []


def test_records_are_read_from_a_folder_that_cannot_be_locked(tmp_path: Path) -> None:
    first = Database(tmp_path)
    JournalTable(first).write(ONE, OLD)
    first.close()
    (tmp_path / "broker.lock").unlink()
    (tmp_path / "broker.lock").mkdir()
    assert JournalTable(Database(tmp_path)).read_all() == {ONE: OLD}
