"""A failure of the archive costs the archive alone."""

import os
import sqlite3
from collections.abc import Sequence
from contextlib import AbstractContextManager, closing

import pytest

from edge_server.archive import losses, tables, writer
from edge_server.archive.writer import FlightArchive, Received
from edge_server.config import Config
from tests.unit.edge_server.archive.flown import (
    FINISHED,
    begin,
    figure,
    points,
    report,
    send,
    serve,
)
from tests.unit.edge_server.conftest import Edge


def test_a_locked_archive_delays_no_report(edge: Edge, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(writer, "PAUSE_S", 0.0)
    begin(edge)
    with closing(sqlite3.connect(edge.config.archive_path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        send(edge, "state_vector", sequence_number=1)
        assert figure(edge, "fm_archive_working") == 0
    send(edge, "state_vector", sequence_number=2)
    assert (points(edge), edge.count("telemetry")) == (1, 3)
    assert figure(edge, "fm_archive_working") == 1
    assert figure(edge, "fm_archive_lost_total") == 1


@pytest.mark.usefixtures("no_pause")
def test_a_flight_says_how_many_of_its_reports_it_lacks_also_after_a_restart(edge: Edge) -> None:
    begin(edge)
    lose(edge, 1, 2)
    assert edge.get("/storage", "admin")["archive"]["lost_reports"] == 2
    send(edge, "state_vector", sequence_number=3)
    edge.clock.pass_s(1.0)
    assert edge.get("/flights/1")["lost_reports"] == 2
    report(edge, FINISHED)
    edge.clock.pass_s(100.0)
    begin(edge, 1202)
    assert edge.get("/flights/2")["lost_reports"] == 0
    again = writer.FlightArchive(
        edge.config.archive_path, budget_bytes=2**24, days=30.0, clock=edge.clock
    )
    assert again.figures().lost == 2


@pytest.fixture
def no_pause(monkeypatch: pytest.MonkeyPatch) -> None:
    """The archive is written again at once behind a failure."""
    monkeypatch.setattr(writer, "PAUSE_S", 0.0)


def lose(edge: Edge, *numbers: int) -> None:
    """Report while another program has locked the archive."""
    with closing(sqlite3.connect(edge.config.archive_path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        for number in numbers:
            send(edge, "state_vector", sequence_number=number)


def test_losses_of_a_long_outage_are_told_apart_by_the_minute() -> None:
    """One row for all of it would count in full for each flight that it overlaps."""
    kept = losses.Losses()
    kept.note([(1, 0.0), (2, 1.0), (1, 20.0), (1, 600.0)])
    assert kept.take() == [(1, 0.0, 20.0, 2), (2, 1.0, 1.0, 1), (1, 600.0, 600.0, 1)]


def test_losses_without_an_end_take_no_memory_without_an_end() -> None:
    kept = losses.Losses()
    kept.note((1, 60.0 * minute) for minute in range(3 * losses.KEPT))
    assert kept.count == 3 * losses.KEPT
    assert len(kept.take()) <= losses.KEPT


@pytest.mark.usefixtures("no_pause")
def test_losses_that_were_not_stored_yet_survive_a_regular_end(edge: Edge) -> None:
    begin(edge)
    lose(edge, 1, 2)
    edge.context.archive.close()
    again = writer.FlightArchive(
        edge.config.archive_path, budget_bytes=2**24, days=30.0, clock=edge.clock
    )
    assert again.figures().lost == 2


@pytest.mark.usefixtures("no_pause")
def test_the_count_of_losses_never_falls_while_the_server_runs(edge: Edge) -> None:
    begin(edge)
    lose(edge, 1, 2)
    send(edge, "state_vector", sequence_number=3)
    assert figure(edge, "fm_archive_lost_total") == 2
    edge.context.archive.close()
    for file in tables.files_of(edge.config.archive_path):
        file.unlink(missing_ok=True)
    send(edge, "state_vector", sequence_number=4)
    assert figure(edge, "fm_archive_lost_total") == 2


@pytest.mark.usefixtures("no_pause")
def test_losses_that_are_stored_while_they_are_counted_count_once(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin(edge)
    lose(edge, 1, 2)
    archive, reading = edge.context.archive, edge.context.archive.reading

    def reading_later() -> AbstractContextManager[sqlite3.Connection | None]:
        monkeypatch.undo()
        send(edge, "state_vector", sequence_number=3)  # Another thread stores them just now
        return reading()

    monkeypatch.setattr(archive, "reading", reading_later)
    assert archive.figures().lost == 2


@pytest.mark.usefixtures("no_pause")
def test_losses_that_cannot_be_stored_cost_no_report(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin(edge)
    lose(edge, 1)

    def fail(*_: object) -> None:
        raise FileNotFoundError("the archive is gone")

    monkeypatch.setattr(losses, "store", fail)
    send(edge, "state_vector", sequence_number=2)
    assert figure(edge, "fm_archive_lost_total") == 1
    monkeypatch.undo()
    send(edge, "state_vector", sequence_number=3)
    assert (points(edge), figure(edge, "fm_archive_lost_total")) == (2, 1)


def test_an_archive_of_before_that_has_no_losses_is_read(edge: Edge) -> None:
    begin(edge)
    with closing(sqlite3.connect(edge.config.archive_path, isolation_level=None)) as other:
        other.execute("DROP TABLE lost")
    assert edge.get("/flights/1")["lost_reports"] == 0
    assert edge.get("/storage", "admin")["archive"]["lost_reports"] == 0


def test_an_archive_that_cannot_be_opened_costs_no_report(
    edge: Edge, caplog: pytest.LogCaptureFixture
) -> None:
    edge.config.archive_path.mkdir()
    begin(edge)
    for number in range(3):
        send(edge, "state_vector", sequence_number=number)
    edge.context.archive.maintain(trusts_clock=True)
    assert edge.count("telemetry") == 4
    assert caplog.text.count("the flight archive cannot be written") == 1
    assert edge.ask("GET", "/flights/", "operator").status_code == 503
    assert figure(edge, "fm_archive_lost_total") == 4


def test_an_archive_that_has_no_table_yet_is_an_empty_one(edge: Edge) -> None:
    edge.config.archive_path.touch()
    assert edge.get("/flights/", "operator") == []
    assert edge.get("/alarms/history", "operator") == []


def test_an_alarm_is_not_acknowledged_while_the_archive_is_locked(edge: Edge) -> None:
    send(edge, "alarm")
    with closing(sqlite3.connect(edge.config.archive_path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        answer = edge.ask("POST", "/alarms/history/1/acknowledge", "operator")
    assert answer.status_code == 503
    assert "alarms/history/1" not in edge.ask("GET", "/audit/", "admin").text


@pytest.mark.parametrize("fault", ["no database", "newer"])
def test_an_unusable_archive_is_set_aside(edge: Edge, fault: str) -> None:
    path = edge.config.archive_path
    if fault == "newer":
        with closing(tables.open_for_writing(path, 2**20)) as newer:
            newer.execute(f"PRAGMA user_version={tables.VERSION + 1}")
    else:
        path.write_bytes(b"no database at all" * 1000)
    before = path.read_bytes()
    begin(edge)
    send(edge, "state_vector")
    assert points(edge) == 1
    assert tables.set_aside_path(path).stat().st_size >= len(before) > 0


def test_an_archive_that_somebody_deletes_is_made_again(edge: Edge) -> None:
    begin(edge)
    edge.context.archive.maintain(trusts_clock=False)
    for file in tables.files_of(edge.config.archive_path):
        file.unlink(missing_ok=True)
    edge.context.archive.maintain(trusts_clock=False)
    begin(edge, 1202)
    assert [one["mission_id"] for one in edge.get("/flights/")] == [1202]


def test_a_kill_before_the_archive_loses_that_point_only(
    config: Config, monkeypatch: pytest.MonkeyPatch
) -> None:
    child = os.fork()
    if child == 0:
        edge = serve(config)
        begin(edge)
        send(edge, "state_vector", sequence_number=1)
        monkeypatch.setattr(FlightArchive, "take", _exit)
        send(edge, "state_vector", sequence_number=2)
        os._exit(1)  # Not reached
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
    edge = serve(config)
    edge.clock.pass_s(1.0)
    assert (edge.count("telemetry"), points(edge)) == (3, 1)
    send(edge, "state_vector", sequence_number=3)
    assert points(edge) == 2
    edge.context.database.close()


def _exit(_archive: FlightArchive, _received: Sequence[Received]) -> None:
    os._exit(9)
