"""Orders that lay unread while the process stood still are not carried out minutes later."""

import socket
from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Any

import pytest

from edge_server.connections.exchange import Exchange
from edge_server.connections.framing import FramedRequest
from edge_server.connections.stall import since_boot_s
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import event, mission, plan


@pytest.fixture
def sock() -> Iterator[socket.socket]:
    with socket.socket() as one:
        yield one


def ask(edge: Edge, sock: socket.socket, path: str, body: Any, waited_s: float) -> tuple[int, Any]:
    """Send a request that may have waited so long to be read; gives status and document."""
    request = FramedRequest(b"", is_whole=True)
    arrived_s = since_boot_s() - waited_s
    exchange = Exchange(sock, ("192.0.2.1", 5), ("192.0.2.2", 80), request, arrived_s)
    place = {"gunicorn.socket": exchange}
    answer = edge.ask("POST", path, "operator", json=body, environ_overrides=place)
    return answer.status_code, answer.json


@pytest.mark.parametrize("kind", [1, 101, 102, 103])
def test_an_order_that_waited_longer_than_an_event_is_valid_is_refused(
    edge: Edge, sock: socket.socket, kind: int
) -> None:
    edge.post_plan(plan(mission(1201, 1)))
    edge.acknowledge(edge.work()[-1]["id"], "accepted")
    status, answer = ask(edge, sock, "/events/", event(event_type_id=kind), waited_s=61.0)
    assert status == 409
    assert "may have waited for 61 s: it is not carried out" in answer["message"]
    assert edge.get("/events/") == []


def test_an_event_that_has_waited_expires_earlier(edge: Edge, sock: socket.socket) -> None:
    edge.post_plan(plan(mission(1201, 1)))
    edge.acknowledge(edge.work()[-1]["id"], "accepted")
    status, answer = ask(edge, sock, "/events/", event(), waited_s=5.0)
    assert status == 201
    received_at, expires_at = (
        datetime.fromisoformat(answer[name]) for name in ("received_at", "expires_at")
    )
    # As much earlier as the request takes on a busy computer
    assert timedelta(0) < expires_at - received_at < timedelta(seconds=5.1)


def test_a_plan_that_waited_is_not_flown(edge: Edge, sock: socket.socket) -> None:
    document = plan(mission(1201, 1))
    assert ask(edge, sock, "/plans/", document, waited_s=30.0)[0] == 409
    assert edge.get("/plans/") == []
    held = {"plan": document["plan"] | {"dispatch": False}}
    status, kept = ask(edge, sock, "/plans/", held, waited_s=30.0)
    assert status == 201, kept
    assert ask(edge, sock, f"/plans/{kept['id']}/dispatch/", None, waited_s=30.0)[0] == 409
    assert edge.work() == []
