"""A disk that was full takes records again once the cloud has confirmed those that filled it."""

import base64
import os
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random

import pytest
from sqlalchemy import delete

from edge_server.api.routes import health as routes_health
from edge_server.app import context_of, create_app
from edge_server.config import Config
from edge_server.outbox import wakeup
from edge_server.outbox.answers import Answer, Reply
from edge_server.outbox.queue import OutboxRecord
from edge_server.outbox.relay import Relay
from edge_server.outbox.retry import Backoff
from edge_server.outbox.schedule import Schedule
from edge_server.outbox.streams import AllStreams
from edge_server.outbox.uplink import MAXIMUM_BATCH, BatchLimit
from edge_server.process.preparation import open_database, prepare
from edge_server.store.files import upkeep
from edge_server.store.migrate import NoSpaceError, is_ready
from edge_server.store.rows.tables import telemetry
from tests.support.small_disk import NoSmallDiskError, fill_up, small_disk
from tests.unit.edge_server import documents
from tests.unit.edge_server.conftest import Clock, Edge

PATIENCE_S = 60.0
PAGE_BYTES = 4096
JPEG = b"\xff\xd8\xff" + bytes(220_000) + b"\xff\xd9"
PICTURE = {"frame": base64.b64encode(JPEG).decode(), "image_size": len(JPEG)}


class Confirming:
    """An uplink to a cloud that takes everything."""

    def batch_limit(self) -> BatchLimit:
        return MAXIMUM_BATCH

    def send(self, records: Sequence[OutboxRecord]) -> list[Reply]:
        return [Answer(200)] * len(records)

    def close(self) -> None:
        """There is no connection."""


@pytest.fixture(params=[20, 40, 128])
def edge(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Edge]:
    """An edge server on a small disk."""
    try:
        with small_disk(tmp_path / "disk", request.param) as folder:
            config = Config(state_dir=folder)
            prepare(config)
            app = create_app(config)
            context = context_of(app)
            yield Edge(app.test_client(), context, Clock(time.time()))
            context.close()
    except NoSmallDiskError as error:
        pytest.skip(f"no file system can be mounted here: {error}")


def drain(edge: Edge) -> None:
    """Run relay and housekeeping until nothing is queued."""
    database = open_database(edge.config)
    relay = Relay(
        database=database,
        schedule=Schedule(
            backoff=Backoff(0.01, 0.1), probe_interval_s=1.0, workers=4, random=Random(1)
        ),
        uplink=Confirming(),
        streams=AllStreams(database, edge.config.database_path),
        wake=wakeup.open_for_reading(edge.config.wake_path),
        workers=4,
        ballast_path=edge.config.ballast_path,
    )
    thread = threading.Thread(target=relay.run)
    thread.start()
    try:
        deadline = time.monotonic() + PATIENCE_S
        while edge.count("outbox"):
            assert time.monotonic() < deadline, f"{edge.count('outbox')} records are still here"
            edge.context.space.maintain(time.monotonic())
            time.sleep(0.05)
    finally:
        relay.stop()
        thread.join()
        database.close()


def report(edge: Edge, kind: str, number: int) -> int:
    """Report something; returns the status, 201 or 507."""
    more = PICTURE if kind == "image" else {}
    answer = edge.report(kind, documents.telemetry(kind, number) | more)
    assert answer.status_code in {201, 507}, answer.json
    return answer.status_code


def fill(edge: Edge, number: int, kinds: Sequence[str]) -> int:
    """Report until reports are refused; returns the next number."""
    refused = 0
    while refused < 10 * len(kinds):
        status = report(edge, kinds[number % len(kinds)], number)
        refused = 0 if status == 201 else refused + 1
        number += 1
    return number


@pytest.mark.first_case
def test_it_recovers_by_itself_again_and_again(edge: Edge) -> None:
    number = 0
    filler = edge.config.state_dir / "another program"
    for _ in range(3):
        edge.context.space.maintain(time.monotonic())
        number = fill(edge, number, ["image"])
        fill_up(filler)
        number = fill(edge, number, ["pose", "image", "battery"])
        assert edge.count("outbox") > 10
        disk = os.statvfs(edge.config.state_dir)
        assert disk.f_bavail * disk.f_frsize < PAGE_BYTES
        drain(edge)
        for _ in range(5):  # A turn gives back a bounded number of pages
            edge.context.space.maintain(time.monotonic())
        assert edge.config.ballast_path.exists()
        for kind in ("pose", "image", "battery"):
            assert report(edge, kind, number) == 201
            number += 1
        filler.unlink()


@pytest.mark.first_case
def test_a_disk_that_another_program_filled_is_full_until_it_frees_room(edge: Edge) -> None:
    filler = edge.config.state_dir / "another program"
    edge.context.space.maintain(time.monotonic())
    assert report(edge, "pose", 0) == 201
    fill_up(filler)
    edge.config.ballast_path.unlink()
    fill_up(filler)
    assert report(edge, "pose", 1) == 507
    filler.unlink()
    edge.context.space.maintain(time.monotonic())
    assert report(edge, "pose", 2) == 201


@pytest.mark.first_case
def test_a_start_on_a_full_disk_uses_the_ballast(edge: Edge) -> None:
    edge.context.space.maintain(time.monotonic())
    assert report(edge, "pose", 0) == 201
    edge.context.database.close()
    fill_up(edge.config.state_dir / "another program")
    prepare(edge.config)
    assert not edge.config.ballast_path.exists()
    assert edge.count("telemetry") == 1


@pytest.mark.first_case
def test_a_start_on_a_full_disk_without_ballast_uses_the_reserve_for_it(edge: Edge) -> None:
    """The server had used up the ballast, and was restarted while the disk was kept full: STOP."""
    filler = edge.config.state_dir / "another program"
    edge.context.space.maintain(time.monotonic())
    edge.register(1)
    assert edge.post_plan(documents.plan()).status_code == 201
    edge.accept()
    assert report(edge, "pose", 0) == 201
    fill_up(filler)
    edge.config.ballast_path.unlink()
    edge.context.database.close()
    fill_up(filler)
    prepare(edge.config)
    assert report(edge, "pose", 1) == 507
    assert report(edge, "alarm", 2) == 201
    assert edge.post("/events/", documents.event(), "operator").status_code == 201
    filler.unlink()
    edge.context.space.maintain(time.monotonic())
    assert edge.config.ballast_path.exists()
    assert edge.config.start_reserve_path.exists()


@pytest.mark.first_case
def test_a_start_on_a_disk_without_any_room_says_so(edge: Edge) -> None:
    filler = edge.config.state_dir / "another program"
    edge.context.space.maintain(time.monotonic())
    edge.context.database.close()
    edge.config.ballast_path.unlink()
    edge.config.start_reserve_path.unlink()
    fill_up(filler)
    with pytest.raises(NoSpaceError, match="is full; free some space there"):
        prepare(edge.config)
    filler.unlink()
    prepare(edge.config)


@pytest.mark.first_case
def test_a_first_start_on_a_full_disk_asks_for_room_and_works_with_it(edge: Edge) -> None:
    filler = edge.config.state_dir / "another program"
    fill_up(filler)
    config = Config(state_dir=edge.config.state_dir / "new")
    with pytest.raises(NoSpaceError, match="is full; free some space there"):
        prepare(config)
    filler.unlink()
    prepare(config)
    assert is_ready(config.database)


@pytest.mark.first_case
@pytest.mark.parametrize("rounds", [400])
def test_stops_are_accepted_while_another_program_takes_whatever_is_free(
    edge: Edge, rounds: int
) -> None:
    """A drone flies for minutes, is updated twice a second, and is asked to pause and to stop."""
    filler = edge.config.state_dir / "another program"
    edge.register(1)
    assert edge.post_plan(documents.plan()).status_code == 201
    edge.accept()
    edge.context.space.maintain(time.monotonic())
    number = fill(edge, 0, ["image"])
    fill_up(filler)
    edge.context.space.maintain(time.monotonic())
    accepted = 0
    for turn in range(rounds):
        fill_up(filler)
        state = {"link_state": "connected", "altitude": 5.0 + turn % 7}
        updated = edge.ask("PUT", "/vehicles/1", "broker", json=state)
        assert updated.status_code in {200, 201, 204}, (turn, updated.json)
        if turn == rounds // 2:
            edge.context.space.maintain(time.monotonic())
            fill_up(filler)
        if turn % 40 == 39:
            kind = (101, 102, 1)[accepted % 3]
            answer = edge.post("/events/", documents.event(kind), "operator")
            assert answer.status_code == 201, (turn, answer.json)
            edge.acknowledge(answer.get_json()["id"], "done")
            accepted += 1
    assert report(edge, "pose", number) == 507
    filler.unlink()


@pytest.mark.first_case
def test_orders_are_accepted_the_moment_the_disk_becomes_full(edge: Edge) -> None:
    """Another program has filled the disk since housekeeping looked at it."""
    edge.register(1)
    assert edge.post_plan(documents.plan()).status_code == 201
    edge.accept()
    edge.context.space.maintain(time.monotonic())
    fill_up(edge.config.state_dir / "another program")
    for number, kind in enumerate((101, 102, 103)):
        answer = edge.post("/events/", documents.event(kind), "operator")
        assert answer.status_code == 201, (number, answer.json)
        fill_up(edge.config.state_dir / f"another program {number}")
    assert report(edge, "pose", 0) == 507
    path, order = f"/events/{answer.get_json()['id']}", documents.event(1)
    assert edge.ask("PUT", path, "operator", json=order).status_code == 200
    assert not edge.config.ballast_path.exists()


@pytest.mark.first_case
def test_the_ballast_is_released_for_what_frees_room(edge: Edge) -> None:
    """The backlog is gone, its pages are free in the file, and nothing else is free anywhere."""
    edge.context.space.maintain(time.monotonic())
    number = fill(edge, 0, ["image"])
    with edge.context.database.write() as connection:
        connection.execute(delete(telemetry))
    upkeep.checkpoint(edge.context.database)
    fill_up(edge.config.state_dir / "another program")
    assert edge.config.ballast_path.exists()
    for _ in range(5):
        edge.context.space.maintain(time.monotonic())
    assert edge.config.ballast_path.exists()
    for kind in ("pose", "image", "battery"):
        assert report(edge, kind, number) == 201
        number += 1


def health(edge: Edge) -> tuple[int, str, str, str]:
    """The status of /readyz, what it says, and the database of /healthz."""
    ready, alive = edge.ask("GET", "/readyz", None), edge.ask("GET", "/healthz", None)
    assert alive.status_code == 200
    said, shown = ready.json or {}, alive.json or {}
    return ready.status_code, said["status"], said["database"], shown["database"]


@pytest.mark.first_case
def test_a_full_disk_shows_in_the_health(edge: Edge, monkeypatch: pytest.MonkeyPatch) -> None:
    assert health(edge) == (200, "ready", "ok", "ok")
    fill_up(edge.config.state_dir / "another program")
    fill(edge, 0, ["pose"])
    assert health(edge) == (200, "degraded", "not writable", "not writable")
    (edge.config.state_dir / "another program").unlink()
    assert health(edge)[1] == "degraded"  # For a while: what fits shows nothing of what does not
    monkeypatch.setattr(routes_health, "REFUSAL_SHOWS_S", 0.0)
    assert health(edge) == (200, "ready", "ok", "ok")


def test_a_read_only_disk_shows_in_the_health_before_anything_is_refused(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kernel makes it read-only under open files; who may mount may not do that."""
    monkeypatch.setattr(routes_health, "is_read_only", lambda _folder: True)
    assert health(edge) == (200, "degraded", "not writable", "not writable")
