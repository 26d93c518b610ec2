"""The archive keeps to its days and MiB, and gives way when the disk is short."""

import base64
import shutil
import sqlite3
from collections import namedtuple
from contextlib import closing
from dataclasses import replace
from typing import Any

import pytest

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


def test_the_archive_gives_way_when_the_disk_is_short(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = namedtuple("usage", "total used free")  # noqa: PYI024  # as shutil's
    for number in (1, 2):
        fly(edge, number)
    with monkeypatch.context() as patch:
        patch.setattr(shutil, "disk_usage", lambda _: usage(100_000 * MIB, 0, 40 * MIB))
        edge.context.archive.maintain(trusts_clock=False)
        assert flown(edge) == []
        fly(edge, 3)
        assert flown(edge) == []
    assert edge.count("telemetry") == 9
    edge.context.archive.maintain(trusts_clock=False)
    fly(edge, 4)
    assert flown(edge) == [4]


def test_the_file_is_deleted_if_nothing_else_helps_and_begun_again_when_there_is_room(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = namedtuple("usage", "total used free")  # noqa: PYI024  # as shutil's
    begin(edge)
    with monkeypatch.context() as patch:
        patch.setattr(shutil, "disk_usage", lambda _: usage(100_000 * MIB, 0, 10 * MIB))
        for _ in range(2):
            edge.context.archive.maintain(trusts_clock=False)
            assert not edge.config.archive_path.exists()
            assert not edge.context.archive.figures().is_working
        fly(edge, 2)
        assert flown(edge) == []
    assert edge.count("telemetry") == 4
    edge.context.archive.maintain(trusts_clock=False)
    assert edge.context.archive.figures().is_working
    fly(edge, 3)
    assert flown(edge) == [3]
    assert [flight["id"] for flight in edge.get("/flights/")] == [2]  # A link to 1 shows no other
