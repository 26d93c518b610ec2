"""A server that drips, stalls or never ends keeps a thread no longer than the whole deadline.

Requests to the edge server have its key, its headers, its data.
"""

import http.server
import logging
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import chain, repeat
from pathlib import Path

import pytest
import requests

from mavlink_broker.edge import bounded_http
from mavlink_broker.edge.bounded_http import (
    INSTANCE_HEADER,
    Answer,
    BoundedHttp,
    EdgeConnection,
    TooLargeError,
)

DEADLINE_S = 0.4
PIECES = 100
"""A dripping answer lasts far longer than the deadline, and is whole and right at its end."""
PAUSE_S = 0.05
OK = b"HTTP/1.1 200 OK\r\n"
LENGTH = b"Content-Length: 100\r\n\r\n"


def dripping(before: bytes, drops: bytes, behind: bytes = b"") -> Iterator[bytes]:
    yield before
    for drop in drops:
        time.sleep(PAUSE_S)
        yield bytes((drop,))
    yield behind


def silence() -> Iterator[bytes]:
    for _ in range(PIECES):
        time.sleep(PAUSE_S)
        yield b""
    yield OK + LENGTH + b"x" * 100


class Script:
    """What a server sends, and whether it was complete: the connection was not cut."""

    def __init__(self, pieces: Callable[[], Iterator[bytes]]) -> None:
        self._pieces = pieces
        self.has_ended = False

    def __call__(self) -> Iterator[bytes]:
        yield from self._pieces()
        self.has_ended = True


@contextmanager
def server(pieces: Callable[[], Iterator[bytes]]) -> Iterator[str]:
    """Answer every connection with these pieces, whatever it asks for."""
    listener = socket.create_server(("127.0.0.1", 0))
    stopping = threading.Event()

    def serve() -> None:
        while not stopping.is_set():
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            try:
                with connection:
                    connection.recv(65536)
                    for piece in pieces():
                        if stopping.is_set():
                            return
                        connection.sendall(piece)
            except OSError:
                continue

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}/"
    finally:
        stopping.set()
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()
        thread.join()


def ask(url: str, within_s: float = DEADLINE_S, max_bytes: int = 1 << 20) -> Answer:
    with BoundedHttp() as http:
        return http.exchange(
            "GET", url, within_s=within_s, timeouts_s=(20.0, 20.0), max_bytes=max_bytes
        )


@pytest.mark.first_case
@pytest.mark.parametrize(
    "pieces",
    [
        lambda: dripping(OK + LENGTH, b"x" * PIECES),
        lambda: dripping(OK + b"\r\n", b"x" * PIECES),
        lambda: dripping(OK + b"X-Slow: ", b"x" * PIECES, b"\r\n" + LENGTH + b"x" * 100),
        lambda: dripping(b"", OK + b"X: " + b"x" * PIECES, b"\r\n" + LENGTH + b"x" * 100),
        lambda: chain(
            (OK + b"Transfer-Encoding: chunked\r\n\r\n",),
            chain.from_iterable(dripping(b"", b"", b"1\r\nx\r\n") for _ in range(3)),
            dripping(b"", b"1\r\nx\r\n" * 20, b"0\r\n\r\n"),
        ),
        silence,
    ],
    ids=["body", "body without length", "header", "status line", "chunks", "silence"],
)
def test_an_answer_that_drips_is_given_up_at_the_deadline_of_the_whole(
    pieces: Callable[[], Iterator[bytes]],
) -> None:
    script = Script(pieces)
    with server(script) as url, pytest.raises(requests.Timeout, match="no complete answer"):
        ask(url)
    assert not script.has_ended


def test_an_answer_in_time_is_whole() -> None:
    with server(lambda: iter((OK + LENGTH, b"x" * 60, b"y" * 40))) as url:
        assert ask(url, 30.0) == Answer(200, b"x" * 60 + b"y" * 40)


@pytest.mark.parametrize(
    "pieces",
    [
        (OK + LENGTH, b"x" * 60),
        (OK + b"Transfer-Encoding: chunked\r\n\r\n", b"5\r\nab"),
        (OK + b"Transfer-Encoding: chunked\r\n\r\n", b"zz\r\nab\r\n"),
        (OK + b"Content-Length: -5\r\n\r\n{}",),
        (OK + b"Content-Length: abc\r\n\r\n{}",),
        (b"nonsense\r\n\r\n",),
        (b"",),
    ],
    ids=["cut off", "cut off in a chunk", "broken chunk", "below 0", "abc", "no HTTP", "nothing"],
)
def test_an_answer_that_is_cut_off_or_broken_is_no_answer(pieces: tuple[bytes, ...]) -> None:
    with server(lambda: iter(pieces)) as url, pytest.raises(requests.RequestException):
        ask(url, 30.0)


def test_an_answer_without_end_is_bounded() -> None:
    endless = chain((OK + b"\r\n",), repeat(b"x" * 65536))
    with server(lambda: endless) as url, pytest.raises(TooLargeError):
        ask(url, 30.0)


def test_a_connection_that_was_given_up_is_not_used_again() -> None:
    answers = iter((dripping(OK + LENGTH, b"x" * PIECES), iter((OK + LENGTH, b"y" * 100))))
    how = {"timeouts_s": (20.0, 20.0), "max_bytes": 1000}
    with server(partial(next, answers)) as url, BoundedHttp() as http:
        with pytest.raises(requests.Timeout):
            http.exchange("GET", url, within_s=DEADLINE_S, **how)  # type: ignore[arg-type]  # named
        answer = http.exchange("GET", url, within_s=30.0, **how)  # type: ignore[arg-type]  # named
    assert answer.body == b"y" * 100


def test_a_handshake_that_stalls_is_given_up_too() -> None:
    hello = b"\x16\x03\x03\x40\x00"
    script = Script(lambda: dripping(hello, b"\x02" * PIECES))
    with server(script) as url, pytest.raises(requests.Timeout, match="no complete answer"):
        ask(url.replace("http", "https"))
    assert not script.has_ended


def test_a_file_of_authorities_that_is_missing_is_an_error_of_the_request(tmp_path: Path) -> None:
    authorities = str(tmp_path / "ca.pem")
    error = pytest.raises(requests.RequestException, match=r"ca\.pem")
    with BoundedHttp(authorities) as http, error:
        http.exchange(
            "GET", "https://127.0.0.1:1/", within_s=9.0, timeouts_s=(9.0, 9.0), max_bytes=9
        )


def test_the_connection_is_kept_for_the_next_exchange_and_closed_at_the_end() -> None:
    how = {"within_s": 30.0, "timeouts_s": (20.0, 20.0), "max_bytes": 1000}
    with socket.create_server(("127.0.0.1", 0)) as listener:
        url = f"http://127.0.0.1:{listener.getsockname()[1]}/"
        received: list[bytes] = []

        def serve() -> None:
            connection, _ = listener.accept()
            with connection:
                while received[-1:] != [b""]:
                    received.append(connection.recv(65536))
                    if received[-1]:
                        connection.sendall(OK + LENGTH + b"x" * 100)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        with BoundedHttp() as http:
            for _ in range(2):
                http.exchange("GET", url, **how)  # type: ignore[arg-type]  # named
        thread.join(30.0)
        assert len(received) == 3
        assert received[-1] == b""


def test_headers_that_cannot_be_read_are_one_line_in_the_log(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    # One that has not reported anything yet: hostile answers of other tests may have used it up
    fresh = [bounded_http._BrokenHeaders()]
    monkeypatch.setattr(logging.getLogger("urllib3.connection"), "filters", fresh)
    # The edge server's programs, which other tests load, log less of urllib3
    caplog.set_level(logging.WARNING, logger="urllib3.connection")
    broken = OK + b"this is no header\r\n" + LENGTH + b"x" * 100
    with server(lambda: iter((broken,))) as url:
        answers = [ask(url, within_s=30.0) for _ in range(3)]
    assert {answer.status_code for answer in answers} == {200}
    (record,) = caplog.records
    assert record.exc_info is None
    host = url.removeprefix("http://").removesuffix("/")
    message = record.getMessage()
    assert message.startswith(f"an answer of {host} has headers that cannot be read: ")
    assert "MissingHeaderBodySeparatorDefect" in message
    assert "\n" not in message


def test_the_cause_of_a_failure_is_the_systems_own_text() -> None:
    with BoundedHttp() as http, pytest.raises(requests.ConnectionError) as refused:
        http.exchange(
            "GET", "http://127.0.0.1:1/", within_s=9.0, timeouts_s=(9.0, 9.0), max_bytes=9
        )
    assert bounded_http.cause_of(refused.value) == "[Errno 111] Connection refused"
    with server(silence) as url, BoundedHttp() as http, pytest.raises(requests.Timeout) as late:
        http.exchange("GET", url, within_s=DEADLINE_S, timeouts_s=(9.0, 9.0), max_bytes=9)
    assert bounded_http.cause_of(late.value) == str(late.value)
    assert "no complete answer" in str(late.value)


RECEIVED: list[tuple[dict[str, str], bytes]] = []


class _Recorder(http.server.BaseHTTPRequestHandler):
    """Keeps the headers and the body of each request."""

    def do_PATCH(self) -> None:  # http.server's name
        body = self.rfile.read(int(self.headers["Content-Length"]))
        RECEIVED.append((dict(self.headers), body))
        self.send_response(200)
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, format: str, *values: object) -> None:  # noqa: A002  # The name in http.server
        """Be silent."""


def test_data_are_sent_as_they_are_with_the_key_and_the_instance(tmp_path: Path) -> None:
    (tmp_path / "broker.key").write_text("SECRET")
    with http.server.HTTPServer(("127.0.0.1", 0), _Recorder) as listener:
        RECEIVED.clear()
        thread = threading.Thread(target=listener.handle_request)
        thread.start()
        url = f"http://127.0.0.1:{listener.server_port}"
        with EdgeConnection(url, tmp_path / "broker.key", None, "01BROKER") as edge:
            edge.request("PATCH", "/logs/1", data=b"\0\xff", headers={"Upload-Offset": "7"})
        thread.join()
    ((headers, body),) = RECEIVED
    assert body == b"\0\xff"
    assert headers["Content-Type"] == "application/octet-stream"
    assert headers["Authorization"] == "Bearer SECRET"
    assert headers["Upload-Offset"] == "7"
    assert headers[INSTANCE_HEADER] == "01BROKER"
