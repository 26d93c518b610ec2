"""HTTP connections on which an answer has one deadline and one size for the whole of it.

A timeout of a socket starts again with every byte, so a server that sends a byte now and then
holds its client for ever. Here the timeout of a request counts from the moment at which the client
begins to wait: status line, interim answers, headers and body must all be there when it ends, and
must not be larger than `MAXIMUM_RAW_BYTES` on the line.

The deadline is kept by the reader of the answer, without a thread or timer per request: the relay
sends thousands of small records a second on connections that stay open. The broker, which the edge
server may not import, has a module of the same name for seldom and large exchanges: there a timer
shuts the connection down, so that connecting, the TLS handshake and sending are bounded too.
"""

import http.client
import io
import socket
import time
from typing import Any, Final

from urllib3.connection import HTTPConnection, HTTPSConnection
from urllib3.connectionpool import HTTPConnectionPool, HTTPSConnectionPool

MAXIMUM_RAW_BYTES: Final = 1024 * 1024
"""Of an answer with its headers, chunk sizes and chunk extensions."""


class AnswerTooLargeError(OSError):
    """The answer is larger than any answer that a client of ours reads."""


class _BoundedReader(io.RawIOBase):
    """What a connection receives, until the answer's deadline or size is reached."""

    def __init__(self, raw: io.RawIOBase, sock: socket.socket) -> None:
        self._raw = raw
        self._sock = sock
        self._timeout_s = sock.gettimeout()
        self._deadline = time.monotonic() + (self._timeout_s or float("inf"))
        self._room_bytes = MAXIMUM_RAW_BYTES

    def readable(self) -> bool:
        """Say that this can be read."""
        return True

    def readinto(self, buffer: Any) -> int | None:
        """Receive some bytes; raises TimeoutError or AnswerTooLargeError."""
        if self._timeout_s is None:
            return self._count(self._raw.readinto(buffer))
        left_s = self._deadline - time.monotonic()
        if left_s <= 0.0:
            raise TimeoutError("the answer took too long")
        self._sock.settimeout(left_s)
        try:
            return self._count(self._raw.readinto(buffer))
        finally:
            self._sock.settimeout(self._timeout_s)

    def close(self) -> None:
        """Close what the bytes come from."""
        self._raw.close()
        super().close()

    def _count(self, received: int | None) -> int | None:
        self._room_bytes -= received or 0
        if self._room_bytes < 0:
            raise AnswerTooLargeError(f"an answer of more than {MAXIMUM_RAW_BYTES} bytes")
        return received


class _WholeLines(io.BufferedReader):
    """Reads no line that is cut off: http.client takes an end of connection for a line."""

    def readline(self, size: int | None = -1, /) -> bytes:
        """Read a line with its end; raises IncompleteRead when the connection ends before that."""
        line = super().readline(size)
        if line.endswith(b"\n") or len(line) == size:
            return line
        raise http.client.IncompleteRead(line)


class _BoundedResponse(http.client.HTTPResponse):
    """An answer that is read within the timeout which its socket has when it begins."""

    def __init__(self, sock: socket.socket, *arguments: Any, **options: Any) -> None:
        super().__init__(sock, *arguments, **options)
        raw = self.fp.detach()
        self.fp = _WholeLines(_BoundedReader(raw, sock))


class _BoundedHTTPConnection(HTTPConnection):
    response_class = _BoundedResponse


class _BoundedHTTPSConnection(HTTPSConnection):
    response_class = _BoundedResponse


class _BoundedHTTPConnectionPool(HTTPConnectionPool):
    ConnectionCls = _BoundedHTTPConnection


class _BoundedHTTPSConnectionPool(HTTPSConnectionPool):
    ConnectionCls = _BoundedHTTPSConnection


POOLS: Final[dict[str, type[HTTPConnectionPool]]] = {
    "http": _BoundedHTTPConnectionPool,
    "https": _BoundedHTTPSConnectionPool,
}
"""What a PoolManager of urllib3 makes its connections with, by scheme."""
