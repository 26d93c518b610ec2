"""HTTP connections on which a whole answer has one deadline and one maximum size.

A socket's timeout starts again with every byte, so a server that sends a byte from time to time
blocks its client for ever. Here the timeout of a request runs from the moment at which the client
begins to wait: status line, interim answers, headers and body must arrive before it ends, and must
not be larger than `MAXIMUM_RAW_BYTES` on the wire.

Headers that cannot be read may have lost the length of the body, or the answer itself was damaged
on the way: such an answer is broken, whatever its status. `http.client` would read on as if these
headers were not there.

The reader of the answer keeps the deadline, without a thread or timer per request: the relay sends
thousands of small records a second on connections that stay open. The broker, which the edge server
may not import, has a module of the same name for rare and large exchanges: there a timer shuts the
connection down, so that connecting, the TLS handshake and sending are bounded too.
"""

import http.client
import io
import re
import socket
import time
from typing import Any, Final

from requests.adapters import HTTPAdapter
from urllib3.connection import HTTPConnection, HTTPSConnection
from urllib3.connectionpool import HTTPConnectionPool, HTTPSConnectionPool

MAXIMUM_RAW_BYTES: Final = 1024 * 1024
"""Of an answer with its headers, chunk sizes and chunk extensions."""


_NAME: Final = re.compile(r"[!#$%&'*+.^_`|~0-9A-Za-z-]+")
"""Of a header (RFC 9110 section 5.1)."""
_LENGTH: Final = re.compile(r"[0-9]+", re.ASCII)


class BrokenHeadersError(http.client.HTTPException):
    """The headers of the answer cannot be read."""


class AnswerTooLargeError(OSError):
    """The answer is larger than `MAXIMUM_RAW_BYTES`."""


class _BoundedReader(io.RawIOBase):
    """The bytes of a connection, up to the answer's deadline or maximum size."""

    def __init__(self, raw: io.RawIOBase, sock: socket.socket) -> None:
        self._raw = raw
        self._sock = sock
        self._timeout_s = sock.gettimeout()
        self._deadline = time.monotonic() + (self._timeout_s or float("inf"))
        self._room_bytes = MAXIMUM_RAW_BYTES

    def readable(self) -> bool:
        """Return True."""
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
        """Close the underlying stream."""
        self._raw.close()
        super().close()

    def _count(self, received: int | None) -> int | None:
        self._room_bytes -= received or 0
        if self._room_bytes < 0:
            raise AnswerTooLargeError(f"an answer of more than {MAXIMUM_RAW_BYTES} bytes")
        return received


class _WholeLines(io.BufferedReader):
    """Raises on a line that is cut off, which http.client would accept as a line."""

    def readline(self, size: int | None = -1, /) -> bytes:
        """Read a line with its end; raises IncompleteRead when the connection ends before that."""
        line = super().readline(size)
        if line.endswith(b"\n") or len(line) == size:
            return line
        raise http.client.IncompleteRead(line)


class _BoundedResponse(http.client.HTTPResponse):
    """An answer that is read within the timeout that its socket has when it begins."""

    def __init__(self, sock: socket.socket, *arguments: Any, **options: Any) -> None:
        super().__init__(sock, *arguments, **options)
        raw = self.fp.detach()
        self.fp = _WholeLines(_BoundedReader(raw, sock))

    def begin(self) -> None:
        """Read status line and headers; raises BrokenHeadersError if they cannot be read."""
        super().begin()
        if fault := _fault_of(self.msg):
            raise BrokenHeadersError(fault)


def _fault_of(headers: http.client.HTTPMessage) -> str | None:
    """Return what of the headers cannot be read; None if all can."""
    if headers.defects:
        return f"a line is no header ({type(headers.defects[0]).__name__})"
    for name, value in headers.items():
        if _NAME.fullmatch(name) is None or "\0" in value:
            return f"the header {name[:40]!r} is damaged"
    lengths = {value.strip() for value in headers.get_all("Content-Length", [])}
    if len(lengths) > 1 or any(_LENGTH.fullmatch(one) is None for one in lengths):
        return "Content-Length is no length"
    return None


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
"""Connection pools for a PoolManager of urllib3, by scheme."""


class PinnedAdapter(HTTPAdapter):
    """One kept-alive bounded connection without retries, with a pinned certificate if one is given.

    The pin is the SHA-256 of the certificate itself: with it, no certificate authority can vouch
    for another server, nor can the portal of a guest network. The whole answer has to arrive within
    the read timeout of the request.
    """

    def __init__(self, fingerprint: str | None) -> None:
        self._pin = {"assert_fingerprint": fingerprint} if fingerprint else {}
        super().__init__(pool_maxsize=1, max_retries=0)

    def init_poolmanager(
        self,
        connections: int,
        maxsize: int,
        block: bool = False,  # noqa: FBT001, FBT002  # as requests calls it
        **options: Any,
    ) -> None:
        """Make direct connections."""
        super().init_poolmanager(connections, maxsize, block, **options, **self._pin)
        self.poolmanager.pool_classes_by_scheme = POOLS

    def proxy_manager_for(self, proxy: str, **options: Any) -> Any:
        """Make connections through a proxy."""
        manager = super().proxy_manager_for(proxy, **options, **self._pin)
        manager.pool_classes_by_scheme = POOLS
        return manager
