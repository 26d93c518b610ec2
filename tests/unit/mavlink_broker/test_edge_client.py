"""The edge server over real HTTP: retried until answered, in order, the key when it is there."""

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mavlink_broker.edge_client import EdgeClient, is_final
from mavlink_broker.send_queue import Post, Urgency
from tests.support.broker_world import first_flight
from tests.support.fake_edge import FakeEdgeServer

KEY = "broker-key"


@pytest.fixture
def server() -> Iterator[FakeEdgeServer]:
    with FakeEdgeServer(0, KEY).running() as running:
        yield running


class Woken:
    def __init__(self) -> None:
        self.event = threading.Event()

    def __call__(self) -> None:
        self.event.set()


def client_of(server: FakeEdgeServer, folder: Path, woken: Woken | None = None) -> EdgeClient:
    client = EdgeClient(server.url, folder / "broker.key", woken or Woken())
    client.start()
    return client


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


def test_posts_arrive_in_order(server: FakeEdgeServer, tmp_path: Path) -> None:
    (tmp_path / "broker.key").write_text(KEY + "\n")
    client = client_of(server, tmp_path)
    for number in range(20):
        client.post(pose(number))
    assert numbers(server.wait_for("/pose/", 20)) == list(range(20))
    client.stop(1.0)
    assert client.waiting == 0


def test_a_failed_post_is_repeated_with_its_key_and_never_overtaken(
    server: FakeEdgeServer, tmp_path: Path
) -> None:
    (tmp_path / "broker.key").write_text(KEY)
    server.failures.extend([500, 503, 429])
    client = client_of(server, tmp_path)
    client.post(pose(0))
    client.post(pose(1))
    assert numbers(server.wait_for("/pose/", 2)) == [0, 1]
    client.stop(1.0)
    keys = [key for path, key in server.keys_seen if path == "/pose/"]
    assert keys == ["key-0"] * 4 + ["key-1"]


def test_a_final_refusal_is_not_repeated(server: FakeEdgeServer, tmp_path: Path) -> None:
    (tmp_path / "broker.key").write_text(KEY)
    server.failures.append(422)
    client = client_of(server, tmp_path)
    client.post(pose(0))
    client.post(pose(1))
    assert numbers(server.wait_for("/pose/", 1)) == [1]
    client.stop(1.0)


def test_the_key_may_come_later_or_change(server: FakeEdgeServer, tmp_path: Path) -> None:
    client = client_of(server, tmp_path)
    client.post(pose(0))
    assert server.wait_for("/pose/", 1, timeout_s=0.3) == []
    (tmp_path / "broker.key").write_text("of yesterday")
    (tmp_path / "broker.key").write_text(KEY)
    assert numbers(server.wait_for("/pose/", 1)) == [0]
    server.key = "of tomorrow"
    (tmp_path / "broker.key").write_text("of tomorrow")
    client.post(pose(1))
    assert numbers(server.wait_for("/pose/", 2)) == [0, 1]
    client.stop(1.0)


def test_work_wakes_the_loop(server: FakeEdgeServer, tmp_path: Path) -> None:
    (tmp_path / "broker.key").write_text(KEY)
    woken = Woken()
    client = client_of(server, tmp_path, woken)
    server.plan(first_flight())
    assert woken.event.wait(10.0)
    assert client.take_work()[0]["mission"]["mission_id"] == 1201
    assert client.take_work() == []
    client.stop(0.1)


@pytest.mark.parametrize(
    ("status", "final"),
    [
        (200, True),
        (201, True),
        (204, True),
        (301, False),
        (400, True),
        (401, False),
        (403, False),
        (404, True),
        (408, False),
        (409, True),
        (422, True),
        (425, False),
        (429, False),
        (500, False),
        (507, False),
    ],
)
def test_what_counts_as_an_answer(status: int, final: bool) -> None:
    assert is_final(status) is final
