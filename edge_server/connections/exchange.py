"""One request and its answer, as a socket for gunicorn's parser.

The parser reads the complete request from memory, so no client can block it. Sending an answer has
a time budget, which grows with each byte that the client receives.
"""

import os
import socket
import time
from collections.abc import Mapping
from typing import Any, Final, Protocol

from edge_server.connections.framing import FramedRequest
from edge_server.connections.stall import since_boot_s

SEND_S: Final = 20.0
"""How long a client may receive nothing of an answer."""
LEAST_RATE_BYTES_S: Final = 16_384.0
"""A client that receives more slowly than this uses up its budget."""
_PIECE_BYTES: Final = 65_536
CONTINUE: Final = b"HTTP/1.1 100 Continue\r\n\r\n"


class Stream(Protocol):
    """An answer without an end, which the loop sends as it comes."""

    def take(self, now: float) -> bytes | None:
        """Give the next bytes, perhaps none; None ends the answer. `now` is monotonic.

        The loop calls it several times a second: it must not block.
        """


class TooSlowError(OSError):
    """The client receives its answer too slowly."""


class Exchange:
    """Takes the place of the connection's socket, for the parser and the writer of the answer."""

    def __init__(
        self,
        sock: socket.socket,
        client: tuple[str, int],
        server: tuple[str, int],
        request: FramedRequest,
        arrived_s: float | None = None,
    ) -> None:
        """Begin with a whole request; `arrived_s`: on `since_boot_s`, now by default."""
        self._arrived_s = since_boot_s() if arrived_s is None else arrived_s
        self.sock = self
        self.client = client
        self.server = server
        self.is_whole = request.is_whole
        self.refusal = request.refusal
        self.reason = request.reason
        self._sock = sock
        self._raw = memoryview(request.raw)
        self._send_budget_s = SEND_S
        self.stream: Stream | None = None
        """What the loop sends from now on."""
        self.has_begun = False
        """Whether the client has been sent a part of its answer, which no other can follow."""

    @property
    def waited_s(self) -> float:
        """How long ago the request has arrived, at the longest."""
        return since_boot_s() - self._arrived_s

    @property
    def is_connected(self) -> bool:
        """Whether the client has neither closed the connection nor vanished with a reset.

        A client that lost its network is connected for as long as TCP takes it to be.
        """
        try:
            with socket.socket(fileno=os.dup(self._sock.fileno())) as plain:  # Below TLS
                return bool(plain.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT))
        except BlockingIOError:
            return True
        except OSError:
            return False

    def begin_stream(self, head: bytes, stream: Stream) -> None:
        """Send the head of an answer without an end; what the view returns is not sent.

        Raises:
            TooSlowError: as `sendall`.
        """
        self.sendall(head)
        self.stream = stream

    def recv(self, size: int) -> bytes:
        """Read the next bytes of the request; none after its end."""
        part, self._raw = self._raw[:size], self._raw[size:]
        return bytes(part)

    def send(self, data: bytes) -> int:
        """Send all of it; drops an interim 100 Continue, since the body is complete."""
        if data != CONTINUE:
            self.sendall(data)
        return len(data)

    def sendall(self, data: bytes) -> None:
        """Send all of it; raises TooSlowError, or OSError if the client has disconnected.

        Once a stream has begun, nothing else is sent.
        """
        rest = memoryview(data if self.stream is None else b"")
        while rest:
            began = time.monotonic()
            self._sock.settimeout(max(self._send_budget_s, 0.001))
            try:
                sent = self._sock.send(rest[:_PIECE_BYTES])
            except TimeoutError:
                raise TooSlowError("the client receives its answer too slowly") from None
            self.has_begun = True
            rest = rest[sent:]
            took_s = time.monotonic() - began
            self._send_budget_s += sent / LEAST_RATE_BYTES_S - took_s
            self._send_budget_s = min(self._send_budget_s, SEND_S)

    def settimeout(self, timeout_s: float | None) -> None:
        """Do nothing: the request is in memory, and sending has a budget of its own."""

    def close(self) -> None:
        """Do nothing: the loop owns the connection."""

    def shutdown(self, how: int) -> None:
        """Do nothing: the loop owns the connection."""


def exchange_of(environ: Mapping[str, Any]) -> Exchange | None:
    """Return the exchange of a request by its WSGI environment; None under another server."""
    exchange = environ.get("gunicorn.socket")
    return exchange if isinstance(exchange, Exchange) else None
