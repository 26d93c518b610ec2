"""A client of the edge server, and the posts that it sends."""

import threading
from pathlib import Path
from typing import Any

from mavlink_broker.edge.client import EdgeClient
from mavlink_broker.edge.outbox import Post, Urgency
from mavlink_broker.edge.spool import Spool
from tests.support import spooled_posts
from tests.support.fake_edge import FakeEdgeServer
from tests.support.polling import wait_until

KEY = "broker-key"
NOWHERE = "http://127.0.0.1:1"


class Woken:
    def __init__(self) -> None:
        self.event = threading.Event()

    def __call__(self) -> None:
        self.event.set()


def client_of(
    server: FakeEdgeServer, folder: Path, woken: Woken | None = None, spool: Spool | None = None
) -> EdgeClient:
    client = EdgeClient(server.url, folder / "broker.key", woken or Woken(), spool=spool)
    client.start()
    return client


def spool_in(folder: Path) -> Spool:
    return spooled_posts.spool_in(folder / "broker")


def report(mission_id: int, status: int) -> Post:
    body = {
        "vehicle_id": 1,
        "mission_id": mission_id,
        "mission_status_id": status,
        "command_report_array": [],
    }
    return Post(
        method="POST",
        path="/mission_report/",
        body=body,
        vehicle_id=1,
        lane="mission_report",
        urgency=Urgency.REPORT,
        idempotency_key=f"report-{mission_id}-{status}",
        needs_registration=False,
    )


def leave(folder: Path, *posts: Post) -> None:
    """Run a broker that ends with posts while the edge server is unreachable."""
    (folder / "broker.key").write_text(KEY)
    spool = spool_in(folder)
    client = EdgeClient(NOWHERE, folder / "broker.key", Woken(), spool=spool)
    client.start()
    for one in posts:
        client.post(one)
    client.stop(0.0)
    spool.database.close()


def pose(number: int) -> Post:
    return Post(
        method="POST",
        path="/pose/",
        body={"sequence_number": number},
        vehicle_id=1,
        lane="pose",
        urgency=Urgency.RESULT,
        idempotency_key=f"key-{number}",
        needs_registration=False,
    )


def numbers(bodies: list[dict[str, Any]]) -> list[int]:
    return [body["sequence_number"] for body in bodies]


def work_of(client: EdgeClient) -> list[dict[str, Any]]:
    """Wait for work; gives what came first."""
    work: list[dict[str, Any]] = []

    def has_arrived() -> bool:
        work.extend(client.take_work())
        return bool(work)

    wait_until(has_arrived)
    return work
