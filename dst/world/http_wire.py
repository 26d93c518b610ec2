"""HTTP answers as bytes, which are cut off or reset anywhere, read by the programs' real clients.

The clients connect as ever, with `requests` and `urllib3`; only the socket is simulated. A request
is answered at once, whole or in part: how long it takes is the scheduler's affair.
"""

import io
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from random import Random
from typing import Any, Final
from unittest.mock import patch

from urllib3.util import connection

Serve = Callable[[bytes], tuple[bytes, bool]]
"""Takes a request; gives the bytes that arrive, and whether the connection is reset after them.

Raises:
    OSError: if there is no connection.
"""
BODY_SHARE: Final = 0.5
RESET_SHARE: Final = 0.3
"""Of the connections that end early."""


def answer_bytes(status: int, body: bytes, headers: Mapping[str, str] | None = None) -> bytes:
    """Write an answer as a server does."""
    reason = HTTPStatus(status).phrase
    fields = {
        "Content-Type": "application/json",
        "Content-Length": str(len(body)),
        **(headers or {}),
        "Connection": "close",
    }
    lines = [f"HTTP/1.1 {status} {reason}", *(f"{name}: {text}" for name, text in fields.items())]
    return "\r\n".join(lines).encode() + b"\r\n\r\n" + body


FOREIGN_ANSWERS: Final = (
    *(
        answer_bytes(status, body, {"Content-Type": "text/html"})
        for status, body in (
            (200, b"<html>Please sign in to the network</html>"),
            (200, b""),
            (200, b"null"),
            (200, b"[]"),
            (201, b'"created"'),
            (200, b'<?xml version="1.0"?><WISPAccessGatewayParam/>'),
            (302, b""),
            (400, b"<html>Bad request</html>"),
            (404, b"<html>Not found</html>"),
            (409, b""),
            (429, b"slow down"),
            (500, b"<html>Internal error</html>"),
            (502, b"<html>Bad gateway</html>"),
            (503, b""),
        )
    ),
    b"SSH-2.0-OpenSSH_9.2\r\n",
    b"HTTP/1.1 200\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
    b"HTTP/1.1 100 Continue\r\n\r\n",
    b"HTTP/1.1 201 Created\r\nContent-Length: -1\r\n\r\n<html>",
    b"\x16\x03\x01\x00\x02\x02\x28",
)
"""Of somebody else at the edge server's address."""


def broken(answer: bytes, random: Random) -> tuple[bytes, bool]:
    """End an answer at any byte, half of them in the body; mostly by closing the connection."""
    body = answer.find(b"\r\n\r\n") + 4
    first = body if body < len(answer) and random.random() < BODY_SHARE else 0
    return answer[: random.randrange(first, len(answer))], random.random() < RESET_SHARE


class _Arrived(io.RawIOBase):
    """The bytes that arrive, then the end or a reset."""

    def __init__(self, data: bytes, *, is_reset: bool) -> None:
        self._data = io.BytesIO(data)
        self._is_reset = is_reset

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        count = self._data.readinto(buffer)
        if not count and self._is_reset:
            raise ConnectionResetError(104, "Connection reset by peer")
        return count


class _Socket:
    """One connection, for one request."""

    def __init__(self, serve: Serve) -> None:
        self._serve = serve
        self._sent = bytearray()
        self._timeout_s: float | None = None

    def sendall(self, data: bytes) -> None:
        self._sent += data

    def makefile(self, *_arguments: Any, **_named: Any) -> io.BufferedReader:
        data, is_reset = self._serve(bytes(self._sent))
        return io.BufferedReader(_Arrived(data, is_reset=is_reset))

    def dup(self) -> "_Socket":
        return self

    def gettimeout(self) -> float | None:
        return self._timeout_s

    def settimeout(self, timeout_s: float | None) -> None:
        self._timeout_s = timeout_s

    def setsockopt(self, *_arguments: Any) -> None:
        """There are no options here."""

    def shutdown(self, _how: int) -> None:
        """There is nothing to shut down."""

    def close(self) -> None:
        """Every connection is closed after its answer."""


@contextmanager
def serving(serve: Serve) -> Iterator[None]:
    """Have each connection of this process answered by `serve`."""

    def connect(*_arguments: Any, **_named: Any) -> _Socket:
        return _Socket(serve)

    with patch.object(connection, "create_connection", connect):
        yield
