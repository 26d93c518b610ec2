"""Posts that outlive the broker: on the disk, sent again, or kept as dead letters."""

import logging
import sqlite3
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from mavlink_broker import database
from mavlink_broker.database import DATABASE_FILE, add_requests
from mavlink_broker.edge.client import EdgeClient
from mavlink_broker.edge.outbox import Urgency
from mavlink_broker.edge.spool import read_dead_letters
from mavlink_broker.edge.wire import post_for
from mavlink_broker.effects import Acknowledgement
from tests.support.broker_world import first_flight
from tests.support.fake_edge import FakeEdgeServer
from tests.support.polling import wait_until
from tests.support.spooled_posts import posts_on_disk
from tests.unit.mavlink_broker.edge.clients import (
    KEY,
    NOWHERE,
    Woken,
    client_of,
    leave,
    numbers,
    pose,
    report,
    spool_in,
    work_of,
)


def test_nothing_is_written_while_the_edge_server_answers(
    server: FakeEdgeServer, tmp_path: Path
) -> None:
    (tmp_path / "broker.key").write_text(KEY)
    spool = spool_in(tmp_path)
    client = client_of(server, tmp_path, spool=spool)
    for number in range(50):
        client.post(pose(number))
    assert len(server.wait_for("/pose/", 50)) == 50
    client.stop(5.0)
    assert spool.database.writes == 0


def test_a_failed_post_is_on_the_disk_before_the_program_ends(tmp_path: Path) -> None:
    """As a kill -9 would leave it."""
    client = EdgeClient(NOWHERE, tmp_path / "no.key", Woken(), spool=spool_in(tmp_path))
    client.start()
    client.post(pose(1))
    client.post(pose(2))
    wait_until(lambda: len(posts_on_disk(tmp_path / "broker")) == 2)
    client.stop(0.0)


def test_the_next_run_first_sends_the_posts_of_the_last_one(
    server: FakeEdgeServer, tmp_path: Path
) -> None:
    leave(tmp_path, pose(0), pose(1))
    server.failures.extend([503, 401])
    spool = spool_in(tmp_path)
    client = client_of(server, tmp_path, spool=spool)
    client.post(pose(2))
    assert numbers(server.wait_for("/pose/", 3)) == [0, 1, 2]
    keys = [key for path, key in server.keys_seen if path == "/pose/"]
    assert list(dict.fromkeys(keys)) == ["key-0", "key-1", "key-2"]
    wait_until(lambda: not posts_on_disk(tmp_path / "broker"))
    client.stop(1.0)


@pytest.mark.thorough
def test_work_is_taken_after_the_reports_of_the_earlier_run_are_sent(
    server: FakeEdgeServer, tmp_path: Path
) -> None:
    """Else a mission that has flown would be flown again."""
    leave(tmp_path, report(1201, 2))
    server.failures.extend([503] * 4)
    server.plan(first_flight())
    client = client_of(server, tmp_path, spool=spool_in(tmp_path))
    work = work_of(client)
    assert work[0]["report"]["mission_status_id"] == 2
    client.stop(1.0)


def test_a_mission_whose_terminal_report_was_unsent_is_not_taken_again(
    server: FakeEdgeServer, tmp_path: Path
) -> None:
    leave(tmp_path, report(1201, 2), report(1201, 3))
    server.plan(first_flight(1201))
    server.failures.extend([500, 500])
    client = client_of(server, tmp_path, spool=spool_in(tmp_path))
    server.plan(first_flight(1202))
    work = work_of(client)
    assert [one["mission"]["mission_id"] for one in work] == [1202]
    client.stop(1.0)


def test_unsent_reports_of_one_vehicle_delay_no_other(
    server: FakeEdgeServer, tmp_path: Path
) -> None:
    leave(tmp_path, report(1201, 2))
    server.failures.extend([503] * 1000)
    server.plan(first_flight(1201, vehicle_id=1))
    server.plan(first_flight(1202, vehicle_id=2))
    client = client_of(server, tmp_path, spool=spool_in(tmp_path))
    work = work_of(client)
    assert {one["mission"]["mission_id"] for one in work} == {1202}
    client.stop(0.0)


def test_results_that_a_full_edge_server_refuses_hold_no_work_back(
    server: FakeEdgeServer, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """An abort reaches a restarted broker, with the mission as the reports leave it."""
    caplog.set_level(logging.WARNING)
    result = replace(pose(0), lane="mission_report", urgency=Urgency.REPORT, may_be_duplicate=True)
    leave(tmp_path, result, report(1201, 2))
    status = {"/pose/": 507}
    server.judge = lambda path, _: status.get(path)
    server.failures.extend([503] * 3)
    server.plan(first_flight())
    event = server.event(1)
    client = client_of(server, tmp_path, spool=spool_in(tmp_path))
    work: dict[int, dict[str, Any]] = {}

    def has_both() -> bool:
        work.update((one["id"], one) for one in client.take_work())
        return len(work) == 2

    wait_until(has_both)
    assert event in work
    (mission,) = (one for one in work.values() if "mission" in one)
    assert mission["report"]["mission_status_id"] == 2
    assert server.edge.bodies("/pose/") == []
    assert "work of vehicle 1 waits until 1 reports or answers to events" in caplog.text
    status.clear()
    server.wait_for("/pose/", 1)
    client.stop(1.0)


@pytest.mark.first_case
@pytest.mark.parametrize("by_earlier_run", [True, False])
def test_a_post_that_is_refused_for_good_is_a_dead_letter_and_can_be_sent_again(
    server: FakeEdgeServer,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    *,
    by_earlier_run: bool,
) -> None:
    leave(tmp_path, *((pose(0), pose(1)) if by_earlier_run else ()))
    server.failures.append(409)
    client = client_of(server, tmp_path, spool=spool_in(tmp_path))
    if not by_earlier_run:
        client.post(pose(0))
        client.post(pose(1))
    assert numbers(server.wait_for("/pose/", 1)) == [1]
    wait_until(lambda: "is given up: HTTP 409" in caplog.text)
    wait_until(lambda: len(read_dead_letters(tmp_path / "broker")) == 1)
    ((number, letter),) = read_dead_letters(tmp_path / "broker")
    assert letter.reason.startswith("HTTP 409")
    assert letter.post.body["sequence_number"] == 0
    wait_until(lambda: client.dead_letters_of(1) == 1)
    wait_until(lambda: not posts_on_disk(tmp_path / "broker"))
    add_requests(tmp_path / "broker", "retry", [number])
    assert numbers(server.wait_for("/pose/", 2)) == [1, 0]
    wait_until(lambda: client.dead_letters_of(1) == 0)
    client.stop(1.0)


def test_a_state_vector_or_a_withdrawn_acceptance_is_not_a_dead_letter(
    server: FakeEdgeServer, tmp_path: Path
) -> None:
    (tmp_path / "broker.key").write_text(KEY)
    message = Acknowledgement(1, "accepted")
    acceptance = post_for(message, vehicle_id=1, recorded_at=datetime.now(UTC), key="none")
    server.failures.extend([410, 400])
    client = client_of(server, tmp_path, spool=spool_in(tmp_path))
    client.post(acceptance)
    wait_until(lambda: len(client.take_acceptance_results()) == 1)
    client.post(replace(pose(0), lane="state_vector", may_be_dropped=True))
    client.post(replace(pose(1), lane="state_vector", may_be_dropped=True))
    assert numbers(server.wait_for("/pose/", 1)) == [1]
    assert client._outbox.dropped == 1
    client.stop(5.0)
    assert read_dead_letters(tmp_path / "broker") == []


def test_a_disk_that_hangs_delays_no_post(
    server: FakeEdgeServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database, "BUSY_TIMEOUT_S", 60.0)
    (tmp_path / "broker.key").write_text(KEY)
    server.failures.append(503)
    spool = spool_in(tmp_path)
    client = client_of(server, tmp_path, spool=spool)
    other = sqlite3.connect(tmp_path / "broker" / DATABASE_FILE, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    client.post(pose(0))
    wait_until(lambda: spool.database.writes > 0)
    client.post(pose(1))
    assert numbers(server.wait_for("/pose/", 2)) == [0, 1]
    other.close()
    client.stop(1.0)
    assert posts_on_disk(tmp_path / "broker") == []
