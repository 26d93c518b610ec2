"""One connection: its socket, how far its request has come, and until when it may wait.

```mermaid
stateDiagram-v2
    HANDSHAKE --> READING: TLS agreed
    READING --> SERVING: request whole
    SERVING --> READING: answered, kept alive
    SERVING --> LINGERING: answered, to be closed
    READING --> LINGERING: refused
    HANDSHAKE --> CLOSED: late, broken
    READING --> CLOSED: late, gone, evicted
    LINGERING --> CLOSED: late, gone, evicted
```
"""

import selectors
import socket
import ssl
from enum import Enum, auto
from typing import Final

from edge_server.front.admission import BODY_S, HEAD_S, KEEP_ALIVE_S, LINGER_BYTES, LINGER_S, Reason
from edge_server.front.framing import RequestFraming, Stage

_RECEIVED_BYTES: Final = 65_536
_CONTINUE: Final = b"HTTP/1.1 100 Continue\r\n\r\n"


class Phase(Enum):
    """Where a connection is."""

    HANDSHAKE = auto()
    READING = auto()
    SERVING = auto()
    LINGERING = auto()
    CLOSED = auto()


class Connection:
    """Owned by the front's loop, except while it is SERVING; times are monotonic seconds."""

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

    @property
    def kept_bytes(self) -> int:
        """How much of a request is kept."""
        return self.framing.kept_bytes

    @property
    def has_begun(self) -> bool:
        """Whether there is a part of a request, so that its client should know why it is closed."""
        return self.phase is Phase.READING and self.kept_bytes > 0

    @property
    def is_idle(self) -> bool:
        """Whether nothing of a request is here."""
        return self.phase is Phase.READING and not self.kept_bytes

    def on_ready(self, now: float) -> bool:
        """Let the network move; returns whether a request is whole.

        One call takes what one `recv` gives, and what TLS has decrypted already, so that a client
        that sends without a pause shares the thread with all others.

        Raises:
            OSError: when the connection is of no use any more, EOFError when it has ended.
        """
        if self.phase is Phase.HANDSHAKE and not self._shake_hands():
            return False
        if self.phase is Phase.LINGERING:
            self._discard()
            return False
        while (data := self._receive()) is not None:
            if not data:
                raise EOFError
            self._take_in(data, now)
            if self.framing.stage is Stage.READY:
                return True
            if not (isinstance(self.sock, ssl.SSLSocket) and self.sock.pending()):
                break
        return False

    def _shake_hands(self) -> bool:
        assert isinstance(self.sock, ssl.SSLSocket)  # noqa: S101  # only those begin so
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
        """Receive what is there; None when nothing is, no bytes at the end."""
        try:
            return self.sock.recv(_RECEIVED_BYTES)
        except (BlockingIOError, InterruptedError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
            return None

    def _take_in(self, data: bytes, now: float) -> None:
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
                self.sock.send(_CONTINUE)

    @property
    def reason_if_late(self) -> Reason:
        """What it has been too slow with."""
        return Reason.SLOW_BODY if self._stage is Stage.BODY else Reason.SLOW_HEAD

    def answered(self, now: float) -> bool:
        """Wait for the next request; returns whether it is here already."""
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
        """Send no more, and read what still comes, so that the answer is not lost to a reset."""
        self.sock.settimeout(0.0)
        self.sock.shutdown(socket.SHUT_WR)
        self.phase = Phase.LINGERING
        self.has_been_served = False
        self.since = now
        self.deadline = now + LINGER_S

    def _discard(self) -> None:
        while (data := self._receive()) is not None:
            self._lingered_bytes += len(data)
            if not data or self._lingered_bytes > LINGER_BYTES:
                raise EOFError

    def close(self) -> None:
        """End it."""
        self.phase = Phase.CLOSED
        self.sock.close()
