"""Answers of the server before the application, and those that it cannot complete."""

import json
import socket
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from gunicorn.config import Config  # type: ignore[import-untyped]  # it has no types

from edge_server.connections.exchange import Exchange
from edge_server.connections.framing import FramedRequest
from edge_server.process import workers


@pytest.mark.parametrize(
    ("status", "retry"), [(408, False), (414, False), (431, False), (503, True), (505, False)]
)
def test_a_refusal_has_the_shape_of_every_error(status: int, *, retry: bool) -> None:
    head, _, body = workers._refusal(status).partition(b"\r\n\r\n")
    start, *fields = head.decode().split("\r\n")
    headers = dict(field.split(": ", 1) for field in fields)
    assert start.startswith(f"HTTP/1.1 {status} ")
    assert headers["Content-Length"] == str(len(body))
    assert headers["Connection"] == "close"
    assert ("Retry-After" in headers) == retry
    assert json.loads(body) | {"request_id": ""} == {
        "message": workers._SENTENCES[status],
        "detail": {},
        "request_id": "",
    }


def test_a_refusal_gives_a_reason_where_the_status_does_not() -> None:
    body = workers._refusal(400, "the header field Host is present twice").partition(b"\r\n\r\n")[2]
    assert json.loads(body)["message"] == "the header field Host is present twice"


def served(application: Callable[..., Iterator[bytes]]) -> bytes:
    """Give what a client receives whose connection is closed, as it must be."""
    config = Config()
    worker = workers.EdgeWorker(1, 0, [], None, 30, config, workers.EdgeLogger(config))
    worker.wsgi = application
    worker.tmp.close()  # Of the heartbeat, which it does not send
    client, server = socket.socketpair()
    with client:
        with server:
            request = FramedRequest(b"GET / HTTP/1.1\r\nHost: farm\r\n\r\n", is_whole=True)
            exchange = Exchange(server, ("192.0.2.1", 5), ("192.0.2.2", 80), request)
            assert not worker._serve(exchange)
        return b"".join(iter(lambda: client.recv(65_536), b""))


@pytest.mark.parametrize(
    ("headers", "begun"),
    [
        ([], b"5\r\nfirst\r\n"),
        ([("Content-Length", "10")], b"first"),
    ],
    ids=["chunked", "with a length"],
)
def test_an_answer_that_fails_half_way_is_cut_and_nothing_follows(
    headers: list[tuple[str, str]], begun: bytes
) -> None:
    def fail_half_way(_environ: Any, start_response: Any) -> Iterator[bytes]:
        start_response("200 OK", headers)
        yield b"first"
        raise ValueError("the second part cannot be made")

    head, _, body = served(fail_half_way).partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 200 OK")
    assert body == begun


def test_a_request_that_fails_before_its_answer_is_answered() -> None:
    def fail_at_once(_environ: Any, _start_response: Any) -> Iterator[bytes]:
        raise ValueError("no part can be made")

    assert served(fail_at_once).startswith(b"HTTP/1.1 500 ")
