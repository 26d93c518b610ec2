"""The archive keeps to its days and MiB, and gives way when the disk is short."""

import base64
import shutil
import sqlite3
from contextlib import closing
from dataclasses import replace
from typing import Any, NamedTuple

import pytest

from edge_server.archive import tables, upkeep
from edge_server.archive.shortage import PATIENCE_S
from edge_server.archive.writer import PAUSE_S
from edge_server.config import Config
from tests.unit.edge_server.archive.flown import FINISHED, begin, figure, report, send, serve
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import JPEG

MIB = 1024 * 1024
LARGE = JPEG + bytes(300_000)


def fly(edge: Edge, number: int) -> None:
    begin(edge, number)
    send(edge, "image", **picture())
    report(edge, FINISHED, mission_id=number)
    edge.clock.pass_s(100.0)


def picture() -> dict[str, Any]:
    return {"image_size": len(LARGE), "frame": base64.b64encode(LARGE).decode()}


def flown(edge: Edge) -> list[int]:
    return [flight["mission_id"] for flight in edge.get("/flights/")]


def test_the_oldest_flights_make_room_for_new_ones(config: Config) -> None:
    edge = serve(replace(config, archive_mib=1))
    for number in range(1, 6):
        fly(edge, number)
        edge.context.archive.maintain(trusts_clock=False)
    assert flown(edge) == [4, 5] or flown(edge) == [3, 4, 5]
    assert all(len(edge.get(f"/flights/{one}/pictures")) == 1 for one in flown(edge))
    assert edge.config.archive_path.stat().st_size <= MIB
    assert edge.count("telemetry") == 15  # Each record still waits for the cloud
    edge.context.database.close()


def test_a_flight_that_outgrows_the_budget_keeps_its_beginning(config: Config) -> None:
    edge = serve(replace(config, archive_mib=1))
    begin(edge)
    for number in range(5):
        send(edge, "image", sequence_number=number, **picture())
    assert len(edge.get("/flights/1/pictures")) == 3
    assert figure(edge, "fm_archive_lost_total") == 2
    assert edge.count("telemetry") == 6
    edge.context.database.close()


def test_what_is_deleted_is_returned_to_the_disk_at_once(config: Config) -> None:
    edge = serve(replace(config, archive_mib=1))
    for number in range(1, 4):
        fly(edge, number)
    edge.clock.pass_s(31 * 86_400.0)
    edge.context.archive.maintain(trusts_clock=True)
    with closing(sqlite3.connect(edge.config.archive_path)) as archive:
        assert archive.execute("PRAGMA freelist_count").fetchone() == (0,)
    edge.context.database.close()


def test_old_flights_are_dropped_by_a_clock_that_may_be_trusted(edge: Edge) -> None:
    fly(edge, 1)
    send(edge, "alarm")
    edge.clock.pass_s(29 * 86_400.0)
    edge.context.archive.maintain(trusts_clock=True)
    assert flown(edge) == [1]
    edge.clock.pass_s(2 * 86_400.0)
    edge.context.archive.maintain(trusts_clock=False)
    assert flown(edge) == [1]
    edge.context.archive.maintain(trusts_clock=True)
    assert (flown(edge), edge.get("/alarms/history/")) == ([], [])


def test_a_flight_that_nobody_reports_on_has_ended(edge: Edge) -> None:
    begin(edge)
    edge.clock.pass_s(60.0)
    send(edge, "state_vector")
    edge.clock.pass_s(13 * 3600.0)
    edge.context.archive.maintain(trusts_clock=True)
    assert edge.get("/flights/1")["ended_at"] == "2026-11-21T12:01:00Z"


def test_no_mib_is_no_archive(config: Config) -> None:
    edge = serve(replace(config, archive_mib=0))
    fly(edge, 1)
    assert (edge.get("/flights/"), edge.get("/alarms/history/")) == ([], [])
    assert not edge.config.archive_path.exists()
    edge.context.database.close()


class Usage(NamedTuple):
    """What is read of `shutil.disk_usage` [bytes]."""

    total: int
    free: int


class Disk:
    """A disk that another program has filled up to some bytes, with the archive on it."""

    def __init__(self, edge: Edge, patch: pytest.MonkeyPatch) -> None:
        self._edge = edge
        self._free = 1000 * MIB
        patch.setattr(shutil, "disk_usage", lambda _: Usage(100_000 * MIB, self.free))

    @property
    def free(self) -> int:
        """What is left of `leave` and of the growth of the archive since [bytes]."""
        return self._free - self._size()

    def leave(self, free: int) -> None:
        if self._size():
            with closing(sqlite3.connect(self._edge.config.archive_path)) as archive:
                archive.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
        self._free = free + self._size()

    def _size(self) -> int:
        files = tables.files_of(self._edge.config.archive_path)
        return sum(file.stat().st_size for file in files if file.exists())


@pytest.fixture
def disk(edge: Edge, monkeypatch: pytest.MonkeyPatch) -> Disk:
    return Disk(edge, monkeypatch)


def look(edge: Edge, lacking_bytes: int = 0) -> None:
    edge.context.archive.maintain(trusts_clock=False, lacking_bytes=lacking_bytes)


def test_a_short_disk_costs_no_flight_within_a_minute(edge: Edge, disk: Disk) -> None:
    for number in (1, 2):
        fly(edge, number)
    disk.leave(64 * MIB - 1)
    look(edge)
    assert not edge.context.archive.figures().is_working
    fly(edge, 3)  # Nothing is archived, at once
    disk.leave(64 * MIB)
    look(edge)
    disk.leave(64 * MIB - 1)
    look(edge)
    edge.clock.pass_s(PATIENCE_S - 1.0)
    look(edge)
    assert flown(edge) == [1, 2]
    disk.leave(64 * MIB)
    look(edge)
    fly(edge, 4)
    assert flown(edge) == [1, 2, 4]
    assert edge.count("telemetry") == 12


def test_after_a_minute_the_oldest_flights_make_room_as_many_as_are_needed(
    edge: Edge, disk: Disk, caplog: pytest.LogCaptureFixture
) -> None:
    for number in range(1, 6):
        fly(edge, number)
    disk.leave(64 * MIB - 400_000)
    look(edge)
    edge.clock.pass_s(PATIENCE_S)
    look(edge)
    assert flown(edge) == [3, 4, 5]
    assert disk.free >= 64 * MIB
    assert edge.context.archive.figures().is_working
    assert caplog.text.count("the oldest flights are dropped") == 1


def test_flights_that_cannot_help_are_kept(
    edge: Edge, disk: Disk, caplog: pytest.LogCaptureFixture
) -> None:
    for number in range(1, 4):
        fly(edge, number)
    begin(edge, 4)
    for number in range(4):  # A flight that has not ended makes no room
        send(edge, "image", sequence_number=number, **picture())
    disk.leave(62 * MIB)
    look(edge)
    edge.clock.pass_s(PATIENCE_S)
    for _ in range(3):
        look(edge, lacking_bytes=63 * MIB)
    assert flown(edge) == [1, 2, 3, 4]
    (said,) = (one for one in caplog.messages if "not by flights" in one)
    assert said.endswith(
        "62 MiB are free, 64 MiB are wanted, the flights that have ended use 1 MiB"
    )


def test_records_that_lack_room_get_it_at_once(edge: Edge, disk: Disk) -> None:
    for number in range(1, 5):
        fly(edge, number)
    disk.leave(16 * MIB - 200_000)
    look(edge)
    assert flown(edge) == [1, 2, 3, 4]
    look(edge, lacking_bytes=16 * MIB)
    assert flown(edge) == [2, 3, 4]
    assert disk.free >= 16 * MIB


def test_a_file_that_gives_no_room_back_is_deleted_for_records_that_lack_it(
    edge: Edge, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    fly(edge, 1)
    disk.leave(16 * MIB - 200_000)

    def fails(_: sqlite3.Connection) -> bool:
        raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(upkeep, "drop_part", fails)
        look(edge)
        edge.clock.pass_s(PAUSE_S)
        assert edge.config.archive_path.exists()
        look(edge, lacking_bytes=16 * MIB)
        assert not edge.config.archive_path.exists()
        edge.clock.pass_s(PAUSE_S)
        look(edge)
        assert not edge.context.archive.figures().is_working
        fly(edge, 2)
        assert flown(edge) == []
    assert edge.count("telemetry") == 6
    disk.leave(64 * MIB)
    look(edge)
    fly(edge, 3)
    assert edge.context.archive.figures().is_working
    assert flown(edge) == [3]
    assert [flight["id"] for flight in edge.get("/flights/")] == [2]  # A link to 1 shows no other
