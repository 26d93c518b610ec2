"""A cooperative: two edge servers and two relays on one PostgreSQL database, one cloud.

Records come in at both while one farm's programs are killed and a relay of the other one too. What
was acknowledged reaches the cloud, once in effect, in the order of its stream; and while no process
is killed, no stream has two requests in flight.
"""

import os
import shutil
import signal
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any

import pytest
import requests

from edge_server.store import migrate
from edge_server.store.connection import locks
from tests.support.databases import PostgresServer
from tests.support.fake_cloud import FakeCloud, Handler, Received, running_cloud
from tests.support.polling import PATIENCE_S
from tests.support.process_tree import command_words, descendants
from tests.support.system import wait_for
from tests.unit.edge_server import documents
from tests.unit.edge_server.program import Program, program_in

VEHICLES = (1, 2, 3, 4)
RECORDS = 60  # Of each vehicle


@pytest.fixture
def cloud() -> Iterator[FakeCloud]:
    """A cloud that is there."""
    with running_cloud() as cloud:
        yield cloud


@pytest.fixture
def farms(tmp_path: Path, cloud: FakeCloud, postgres: PostgresServer) -> Iterator[list[Program]]:
    """Two farms' servers and relays on one database, with the same keys."""
    name = postgres.create()
    migrate.prepare(postgres.url(name))
    with ExitStack() as stack:
        farms = [
            stack.enter_context(program_in(tmp_path / farm, cloud.url))
            for farm in ("north", "south")
        ]
        for farm in farms:
            farm.environment["DATABASE_URL"] = postgres.url(name)
            if farm is farms[1]:
                shutil.copytree(farms[0].state_dir / "keys", farm.state_dir / "keys")
            farm.start()
        yield farms
    postgres.drop(name)


class Overlaps:
    """A slow cloud that notes when a stream has two requests in flight."""

    def __init__(self) -> None:
        self.found: list[str] = []
        self._in_transit: Counter[tuple[str, int]] = Counter()
        self._lock = threading.Lock()

    def __call__(self, handler: Handler, received: Received) -> None:
        stream = received.path, int(received.body["vehicle_id"])
        with self._lock:
            self._in_transit[stream] += 1
            if self._in_transit[stream] > 1:
                self.found.append(f"{stream}: {received.body['sequence_number']}")
        time.sleep(0.005)
        with self._lock:
            self._in_transit[stream] -= 1
        handler.store.keep(received)
        handler.answer(200)


def post_all(farms: list[Program], vehicle_id: int) -> None:
    """Post a vehicle's poses in order, each at the next farm's server until one acknowledges it."""
    places = cycle(farms[vehicle_id % 2 :] + farms[: vehicle_id % 2])
    headers = {"X-API-Key": farms[0].key("broker")}
    with requests.Session() as session:
        for number in range(RECORDS):
            body = documents.telemetry("pose", number, vehicle_id)
            key = {"Idempotency-Key": f"{vehicle_id}-{number}"}
            post = partial(_post, session, places, body, headers | key)
            wait_for(post, "an acknowledgement")


def _post(
    session: requests.Session,
    places: Iterator[Program],
    body: dict[str, Any],
    headers: dict[str, str],
) -> bool:
    """Try the next farm's server."""
    url = f"{next(places).url}/pose/"
    return session.post(url, json=body, headers=headers, timeout=30.0).ok


def poses(cloud: FakeCloud) -> int:
    return len(cloud.store.kept)


def relay_of(farm: Program) -> int:
    """Process id of a farm's relay."""
    assert farm.process is not None
    for process_id in descendants(farm.process.pid):
        if "relay" in command_words(process_id):
            return process_id
    raise AssertionError("there is no relay")


def open_relays(farm: Program, postgres: PostgresServer) -> int:
    """Number of relays that report a connection."""
    found = postgres.administer(
        "SELECT count(*) FROM pg_locks JOIN pg_database ON pg_locks.database = pg_database.oid "
        f"WHERE datname = '{name_of(farm)}' AND locktype = 'advisory' "
        f"AND classid = {locks.OPEN_RELAY}"
    )
    return int(found[0][0])


def owners(farm: Program, postgres: PostgresServer) -> int:
    """How many relays have streams."""
    return len(postgres.administer("SELECT DISTINCT owner FROM stream", name_of(farm)))


def name_of(farm: Program) -> str:
    return farm.environment["DATABASE_URL"].partition("?")[0].rpartition("/")[2]


@pytest.mark.thorough
def test_killed_under_load_nothing_acknowledged_is_lost_doubled_or_out_of_order(
    farms: list[Program], cloud: FakeCloud, postgres: PostgresServer
) -> None:
    overlaps = Overlaps()
    cloud.store.always = overlaps
    wait_for(lambda: open_relays(farms[0], postgres) == 2, "both relays")
    with ThreadPoolExecutor(len(VEHICLES)) as together:
        posted = [together.submit(post_all, farms, vehicle_id) for vehicle_id in VEHICLES]
        cloud.store.wait_until(lambda: poses(cloud) >= RECORDS, PATIENCE_S)
        undisturbed = list(overlaps.found)
        wait_for(
            lambda: owners(farms[0], postgres) >= 2 or all(done.done() for done in posted),
            "two relays with streams, or the end of the load",
        )
        farms[1].end(signal.SIGKILL)
        cloud.store.wait_until(lambda: poses(cloud) >= 2 * RECORDS, PATIENCE_S)
        os.kill(relay_of(farms[0]), signal.SIGKILL)
        for done in posted:
            done.result()
    cloud.store.wait_for(len(VEHICLES) * RECORDS, PATIENCE_S)
    for vehicle_id in VEHICLES:
        assert cloud.store.stream(vehicle_id, "pose") == list(range(RECORDS))
    assert undisturbed == []
