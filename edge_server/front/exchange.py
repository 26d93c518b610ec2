"""One request and its answer, as a socket for the server's parser: whole on the way in.

The parser reads from memory, so no client can make it wait. An answer has a deadline that grows
with what the client takes: one that takes nothing is given up.
"""

import socket
import time
from typing import Final

from edge_server.front.framing import Taken

SEND_S: Final = 20.0
"""So long a client may take nothing of an answer."""
LEAST_RATE_BYTES_S: Final = 16_384.0
"""A client that takes an answer more slowly uses up its patience."""
_PIECE_BYTES: Final = 65_536
_CONTINUE: Final = b"HTTP/1.1 100 Continue\r\n\r\n"


class TooSlowError(OSError):
    """The client does not take its answer."""


class Exchange:
    """What the parser and the answer's writer take for a connection."""

    def __init__(
        self, sock: socket.socket, client: tuple[str, int], server: tuple[str, int], taken: Taken
    ) -> None:
        self.sock = self
        self.client = client
        self.server = server
        self.is_whole = taken.is_whole
        self.refusal = taken.refusal
        self.why = taken.why
        self._sock = sock
        self._raw = memoryview(taken.raw)
        self._patience_s = SEND_S

    def recv(self, size: int) -> bytes:
        """Give the next bytes of the request; none behind its end."""
        part, self._raw = self._raw[:size], self._raw[size:]
        return bytes(part)

    def send(self, data: bytes) -> int:
        """Send all of it; the permission to send a body is left out, it has come already."""
        if data != _CONTINUE:
            self.sendall(data)
        return len(data)

    def sendall(self, data: bytes) -> None:
        """Send all of it; raises TooSlowError, or OSError when the client is gone."""
        rest = memoryview(data)
        while rest:
            began = time.monotonic()
            self._sock.settimeout(max(self._patience_s, 0.001))
            try:
                sent = self._sock.send(rest[:_PIECE_BYTES])
            except TimeoutError:
                raise TooSlowError("the client takes its answer too slowly") from None
            rest = rest[sent:]
            took_s = time.monotonic() - began
            self._patience_s += sent / LEAST_RATE_BYTES_S - took_s
            self._patience_s = min(self._patience_s, SEND_S)

    def close(self) -> None:
        """Leave the connection to its owner."""

    def shutdown(self, how: int) -> None:
        """Leave the connection to its owner."""
