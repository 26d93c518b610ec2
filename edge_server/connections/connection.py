"""One connection: its socket, its phase and its deadline.

```mermaid
stateDiagram-v2
    HANDSHAKE --> READING: handshake complete
    READING --> SERVING: request complete
    SERVING --> READING: answered, kept alive
    SERVING --> LINGERING: answered, to be closed
    SERVING --> STREAMING: its answer has no end
    STREAMING --> CLOSED: end, slow reader, eviction
    READING --> LINGERING: refused
    HANDSHAKE --> CLOSED: timeout, failure
    READING --> CLOSED: timeout, end, eviction
    LINGERING --> CLOSED: timeout, end, eviction
```
"""

import selectors
import socket
import ssl
from enum import Enum, auto
from typing import Final

from edge_server.connections.admission import (
    BODY_S,
    HEAD_S,
    KEEP_ALIVE_S,
    LINGER_BYTES,
    LINGER_S,
    Reason,
)
from edge_server.connections.exchange import CONTINUE, Stream
from edge_server.connections.framing import RequestFraming, Stage

_RECEIVED_BYTES: Final = 65_536
UNSENT_S: Final = 20.0
"""How long a reader of a stream may receive nothing of what waits for it."""


class Phase(Enum):
    """Phase of a connection."""

    HANDSHAKE = auto()
    READING = auto()
    SERVING = auto()
    STREAMING = auto()
    LINGERING = auto()
    CLOSED = auto()


class Connection:
    """Owned by the loop, except while it is SERVING; times are monotonic seconds."""

    def __init__(
        self, sock: socket.socket, client: tuple[str, int], network: str, now: float
    ) -> None:
        self.sock = sock
        self.client = client
        self.network = network
        self.framing = RequestFraming()
        self.phase = Phase.HANDSHAKE if isinstance(sock, ssl.SSLSocket) else Phase.READING
        self.since = now
        self.has_been_served = False
        self.deadline = now + HEAD_S
        self.interest = selectors.EVENT_READ
        self._lingered_bytes = 0
        self._stage = Stage.HEAD
        self._has_continued = False
        self._stream: Stream | None = None
        self._unsent = memoryview(b"")

    @property
    def kept_bytes(self) -> int:
        """Size of the request so far, or of what a stream's reader has not received."""
        return self.framing.kept_bytes + len(self._unsent)

    @property
    def has_begun(self) -> bool:
        """Whether a request has begun, so that a timeout is answered."""
        return self.phase is Phase.READING and self.kept_bytes > 0

    @property
    def is_idle(self) -> bool:
        """Whether no request has begun."""
        return self.phase is Phase.READING and not self.kept_bytes

    def on_ready(self, now: float) -> bool:
        """Read what has arrived; returns whether a request is complete.

        One call reads once, and what TLS has decrypted already, so that a client that sends without
        a pause does not occupy the thread.

        Raises:
            OSError: if the connection failed.
            EOFError: if the client closed it.
        """
        if self.phase is Phase.HANDSHAKE and not self._shake_hands():
            return False
        if self.phase is Phase.LINGERING:
            self._discard()
            return False
        if self.phase is Phase.STREAMING:
            self._discard()
            self.send_stream(now)
            return False
        while (data := self._receive()) is not None:
            if not data:
                raise EOFError
            self._feed(data, now)
            if self.framing.stage is Stage.READY:
                return True
            if not (isinstance(self.sock, ssl.SSLSocket) and self.sock.pending()):
                break
        return False

    def _shake_hands(self) -> bool:
        assert isinstance(self.sock, ssl.SSLSocket)  # noqa: S101  # others do not start in HANDSHAKE
        try:
            self.sock.do_handshake()
        except ssl.SSLWantReadError:
            self.interest = selectors.EVENT_READ
            return False
        except ssl.SSLWantWriteError:
            self.interest = selectors.EVENT_WRITE
            return False
        self.interest = selectors.EVENT_READ
        self.phase = Phase.READING
        return True

    def _receive(self) -> bytes | None:
        """Receive; None if nothing has arrived, no bytes at the end of the stream."""
        try:
            return self.sock.recv(_RECEIVED_BYTES)
        except (BlockingIOError, InterruptedError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
            return None

    def _feed(self, data: bytes, now: float) -> None:
        if self.has_been_served and not self.kept_bytes:
            self._begin_request(now)
        self.framing.feed(data)
        self._follow_stage(now)

    def _begin_request(self, now: float) -> None:
        self.has_been_served = False
        self.since = now
        self.deadline = now + HEAD_S
        self._stage = Stage.HEAD
        self._has_continued = False

    def _follow_stage(self, now: float) -> None:
        if self._stage is Stage.HEAD and self.framing.stage is Stage.BODY:
            self._stage = Stage.BODY
            self.deadline = now + BODY_S
            if self.framing.wants_continue and not self._has_continued:
                self._has_continued = True
                self.sock.send(CONTINUE)

    @property
    def timeout_reason(self) -> Reason:
        """Reason of the timeout in this stage."""
        return Reason.SLOW_BODY if self._stage is Stage.BODY else Reason.SLOW_HEAD

    def answered(self, now: float) -> bool:
        """Wait for the next request; returns whether it has arrived already."""
        self.sock.settimeout(0.0)
        self.phase = Phase.READING
        self.since = now
        self.deadline = now + KEEP_ALIVE_S
        self._stage = Stage.HEAD
        self.has_been_served = True
        if self.kept_bytes:
            self._begin_request(now)
            self._follow_stage(now)
        return self.framing.stage is Stage.READY

    def linger(self, now: float) -> None:
        """Shut down sending and discard what arrives, so that no reset destroys the answer."""
        self.sock.settimeout(0.0)
        self.sock.shutdown(socket.SHUT_WR)
        self.phase = Phase.LINGERING
        self.has_been_served = False
        self.since = now
        self.deadline = now + LINGER_S

    def begin_stream(self, stream: Stream, now: float) -> None:
        """Send a stream from now on."""
        self.sock.settimeout(0.0)
        self.phase = Phase.STREAMING
        self.has_been_served = True  # Where there is no room, an unfinished request goes first
        self.since = now
        self.deadline = now + UNSENT_S
        self._stream = stream

    def send_stream(self, now: float) -> None:
        """Send what is new; sets `interest` by whether the reader can receive more.

        What follows is taken from the stream only when everything before it was sent, so a slow
        reader keeps one part of it in memory, however much has changed meanwhile.

        Raises:
            OSError: if the connection failed.
            EOFError: at the end of the stream.
        """
        if not self._unsent:
            data = None if self._stream is None else self._stream.take(now)
            if data is None:
                raise EOFError
            self._unsent = memoryview(data)
        try:
            while self._unsent:
                sent = self.sock.send(self._unsent[:_RECEIVED_BYTES])
                self._unsent = self._unsent[sent:]
                self.deadline = now + UNSENT_S
        except (BlockingIOError, InterruptedError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
            self.interest = selectors.EVENT_READ | selectors.EVENT_WRITE
            return
        self.deadline = now + UNSENT_S
        self.interest = selectors.EVENT_READ

    def _discard(self) -> None:
        while (data := self._receive()) is not None:
            self._lingered_bytes += len(data)
            if not data or self._lingered_bytes > LINGER_BYTES:
                raise EOFError

    def close(self) -> None:
        """Close the socket."""
        self.phase = Phase.CLOSED
        self.sock.close()
