"""What links share: interface, errors, retry timer, byte streams, the rate limit of a radio.

LinkError
└── PortBusyError   another program uses the port

`Stream` is one open byte stream, which never blocks. Frames that the other side does not take are
queued; a full queue drops its oldest whole frames, because only the newest are up to date.
`FrameScanner` finds whole frames in bytes that may start, end and break anywhere. `SinglePeerLink`
is what a serial line and an outgoing TCP connection share: one stream, one peer.

`RateLimiter` limits what is written to a radio by the free buffer in its RADIO_STATUS. A telemetry
radio reads the line faster than it transmits and discards what does not fit. As PX4 does with its
streams, the rate decreases in steps while the buffer fills and increases slowly while it is empty.
These reports are not signed, so a forged one may slow a line down to a tenth but never stops it.
"""

import logging
import os
from abc import ABC, abstractmethod
from collections import deque
from typing import Final, TypeAlias

from mavlink_broker.links.url import Address, LinkUrl
from mavlink_broker.mavlink.codec import checksum_holds, frame_size, next_marker

FIRST_RETRY_S: Final = 0.5
MAX_RETRY_S: Final = 5.0
FRAME_TIMEOUT_S: Final = 1.0
"""Bytes that are not a whole frame by then are noise that looked like a frame's first byte.

The longest frame takes 0.3 s at 9600 baud. Without this limit a stray start byte would swallow the
next 280 bytes of a quiet line.
"""
MAX_READ_BYTES: Final = 16_384
"""Limit of one read, so that a flood cannot block the loop."""
QUEUE_BYTES: Final = 8192
"""Queue size: 1.4 s of a radio at 57,600 baud."""
LOW_FREE_PERCENT: Final = 25
HIGH_FREE_PERCENT: Final = 90
DECREASE: Final = 0.8
INCREASE: Final = 1.05
MIN_FACTOR: Final = 0.1
BITS_PER_BYTE: Final = 10
"""On a serial line: a start bit, eight bits, a stop bit."""
BURST_S: Final = 0.25

Arrival: TypeAlias = tuple[Address, bytes]
"""Sender, and a whole frame or a datagram with any content."""
_LOG = logging.getLogger(__name__)


class LinkError(Exception):
    """A link cannot be opened and retrying cannot help; the text says which link and why."""


class PortBusyError(LinkError):
    """Another program uses the port."""


class Link(ABC):
    """One link; its methods never block."""

    def __init__(self, url: LinkUrl, number: int) -> None:
        """Make the link of a configured URL; `number` is part of its addresses."""
        self.url = url
        self._number = number

    @property
    def port(self) -> int:
        """Port that it listens on, or the configured one."""
        return self.url.port

    @property
    def dropped(self) -> int:
        """Number of frames that could not be sent in time; 0 for a link without a queue."""
        return 0

    @abstractmethod
    def readers(self) -> list[int]:
        """File descriptors to read from."""

    def writers(self) -> list[int]:
        """File descriptors for which data waits to be sent."""
        return []

    def due_at(self) -> float | None:
        """Time of its next timer; None if it has none."""
        return None

    @abstractmethod
    def step(self, ready: frozenset[int], now: float) -> list[Arrival]:
        """Do what is due and return what was received."""

    @abstractmethod
    def send(self, address: Address, frame: bytes) -> None:
        """Send a frame; a frame that cannot be sent is lost, as on any radio."""

    def radio_status(self, free_percent: int) -> None:
        """Follow RADIO_STATUS.txbuf, the free part of a radio's buffer; on a serial line only."""
        del free_percent

    @abstractmethod
    def contact_addresses(self) -> list[Address]:
        """Addresses to which this side must send before it can receive."""

    @abstractmethod
    def close(self) -> None:
        """Close its sockets and devices."""


class RetryTimer:
    """When a link is opened again: after growing pauses, without end; logs each reason once."""

    def __init__(self, url: LinkUrl, longest_s: float = MAX_RETRY_S) -> None:
        self._url = url
        self._longest_s = longest_s
        self._pause_s = FIRST_RETRY_S
        self._reported: str | None = None
        self.at = 0.0

    def failed(self, now: float, reason: str) -> None:
        """Start the next pause."""
        if reason != self._reported:
            _LOG.warning("%s: %s; retrying", self._url, reason)
        self._reported = reason
        self.at = now + self._pause_s
        self._pause_s = min(2.0 * self._pause_s, self._longest_s)

    def opened(self) -> None:
        """Log that it is open; the pauses start again from the shortest only with `reset`."""
        _LOG.info("%s is open", self._url)
        self._reported = None

    def reset(self) -> None:
        """Use short pauses again: a frame was received."""
        self._pause_s = FIRST_RETRY_S


class FrameScanner:
    """Keeps the incomplete end of a read, never more than one frame's length.

    Returns only frames with a correct checksum, so that noise costs no frame after it. The checksum
    of a message that the dialect does not know cannot be checked; such a frame is returned if
    another frame, or nothing, follows it, and if none is in it.
    """

    def __init__(self) -> None:
        self._rest = b""
        self._began_at = 0.0
        self.skipped = 0  # Bytes outside of any frame

    @property
    def is_waiting(self) -> bool:
        """Whether part of a frame has been received."""
        return bool(self._rest)

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Add what was read, possibly nothing, and return the frames that are now whole."""
        frames: list[bytes] = []
        if self._rest and now - self._began_at > FRAME_TIMEOUT_S:
            frames += self._scan(self._rest, is_expired=True)
        if not self._rest:
            self._began_at = now
        if data:
            before = len(self._rest)
            frames += self._scan(self._rest + data, is_expired=False)
            if len(self._rest) <= len(data) or not before:
                self._began_at = now
        return frames

    def _scan(self, data: bytes, *, is_expired: bool) -> list[bytes]:
        self._rest = b""  # An error costs these bytes, and not the link
        frames: list[bytes] = []
        position = 0
        while True:
            start = next_marker(data, position)
            self.skipped += start - position
            if start == len(data):
                return frames
            size = frame_size(data, start)
            if size is None or start + size > len(data):
                if not is_expired:
                    self._rest = data[start:]
                    return frames
                size = 0
            if size and _is_frame(data, start, size):
                position = start + size
                frames.append(data[start:position])
            else:
                position = start + 1
                self.skipped += 1


def _is_frame(data: bytes, start: int, size: int) -> bool:
    end = start + size
    holds = checksum_holds(data[start:end])
    if holds is None:
        is_followed = end == len(data) or next_marker(data, end) == end
        return is_followed and not _contains_frame(data, start + 1, end)
    return holds


def _contains_frame(data: bytes, start: int, end: int) -> bool:
    """Whether a frame with a correct checksum lies there: what was before it is noise."""
    while (start := next_marker(data, start)) < end:
        size = frame_size(data, start)
        if size and start + size <= end and checksum_holds(data[start : start + size]):
            return True
        start += 1
    return False


class RateLimiter:
    """How many bytes may be written; any number without a report or at the full rate."""

    def __init__(self, baud: int) -> None:
        self._line_bytes_s = baud / BITS_PER_BYTE
        self.factor = 1.0
        self._allowance_bytes = 0.0  # May be written at once
        self._at: float | None = None

    @property
    def bytes_s(self) -> float:
        """The current rate."""
        return self.factor * self._line_bytes_s

    def report(self, free_percent: int) -> None:
        """Follow RADIO_STATUS.txbuf, the free part of the radio's buffer."""
        if free_percent < LOW_FREE_PERCENT:
            self.factor = max(MIN_FACTOR, DECREASE * self.factor)
        elif free_percent > HIGH_FREE_PERCENT:
            self.factor = min(1.0, INCREASE * self.factor)

    def allows(self, now: float) -> bool:
        """Whether another frame may be written."""
        if self.factor >= 1.0:
            self._at, self._allowance_bytes = now, 0.0
            return True
        passed_s = 0.0 if self._at is None else now - self._at
        self._at = now
        self._allowance_bytes = min(
            self._allowance_bytes + passed_s * self.bytes_s, BURST_S * self.bytes_s
        )
        return self._allowance_bytes >= 0.0

    def written(self, count: int) -> None:
        """Count bytes that were written."""
        if self.factor < 1.0:
            self._allowance_bytes -= count


class StreamEndedError(Exception):
    """The other side has closed the stream; the text gives the error."""


class Stream:
    """A non-blocking descriptor."""

    def __init__(
        self,
        descriptor: int,
        queue_bytes: int = QUEUE_BYTES,
        rate_limiter: RateLimiter | None = None,
    ) -> None:
        """Use an open descriptor and write no faster than `rate_limiter` allows."""
        self._rate_limiter = rate_limiter
        self._is_rate_limited = False
        self._now = 0.0
        self.descriptor = descriptor
        self._scanner = FrameScanner()
        self._queue: deque[bytes] = deque()
        self._queued = 0
        self._queue_bytes = queue_bytes
        self._is_partly_sent = False  # The first of the queue has left in part
        self.dropped = 0  # Frames

    @property
    def has_backlog(self) -> bool:
        """Whether frames wait until the descriptor takes more."""
        return bool(self._queue) and not self._is_rate_limited

    def read(self, now: float, *, is_readable: bool = True) -> list[bytes]:
        """Return the frames that are now whole.

        Raises:
            StreamEndedError: if the other side has closed it.
        """
        self._now = now
        data = self._bytes() if is_readable else b""
        return self._scanner.feed(data, now)

    def send(self, frame: bytes) -> None:
        """Send a frame, now or when the descriptor takes more.

        Raises:
            StreamEndedError: if the other side has closed it.
        """
        self._queue.append(frame)
        self._queued += len(frame)
        self.flush()
        while self._queued > self._queue_bytes:
            self._drop_oldest()

    def flush(self) -> None:
        """Send queued frames as far as the descriptor takes them.

        Raises:
            StreamEndedError: if the other side has closed it.
        """
        while self._queue:
            self._is_rate_limited = (
                self._rate_limiter is not None and not self._rate_limiter.allows(self._now)
            )
            if self._is_rate_limited:
                return
            frame = self._queue[0]
            try:
                sent = os.write(self.descriptor, frame)
            except BlockingIOError:
                return
            except OSError as error:
                raise StreamEndedError(error.strerror or str(error)) from error
            if self._rate_limiter is not None:
                self._rate_limiter.written(sent)
            self._queued -= sent
            self._is_partly_sent = sent < len(frame)
            if self._is_partly_sent:
                self._queue[0] = frame[sent:]
                return
            self._queue.popleft()

    def _drop_oldest(self) -> None:
        """Drop a frame, but not one that is partly sent: half a frame would damage the next one."""
        partly_sent = [self._queue.popleft()] if self._is_partly_sent else []
        self._queued -= len(self._queue.popleft())
        self._queue.extendleft(partly_sent)
        self.dropped += 1

    def _bytes(self) -> bytes:
        try:
            data = os.read(self.descriptor, MAX_READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise StreamEndedError(error.strerror or str(error)) from error
        if not data:
            raise StreamEndedError("the other side has closed it")
        return data


class SinglePeerLink(Link):
    """A stream that may open and close again; the subclass opens it."""

    def __init__(self, url: LinkUrl, number: int, retry: RetryTimer) -> None:
        super().__init__(url, number)
        self._address = Address(url.host, url.port, number)
        self._retry = retry
        self._stream: Stream | None = None
        self._dropped = 0

    @property
    def dropped(self) -> int:
        """Number of frames that could not be sent in time."""
        return self._dropped + (self._stream.dropped if self._stream else 0)

    def readers(self) -> list[int]:
        """The open stream."""
        return [self._stream.descriptor] if self._stream else []

    def writers(self) -> list[int]:
        """The open stream while data is queued for it."""
        return [self._stream.descriptor] if self._stream and self._stream.has_backlog else []

    def due_at(self) -> float | None:
        """When the stream is opened again."""
        return None if self._stream else self._retry.at

    def contact_addresses(self) -> list[Address]:
        """The other end, while the stream is open."""
        return [self._address] if self._stream else []

    def send(self, address: Address, frame: bytes) -> None:
        """Send a frame, now or when the stream takes more."""
        del address
        if self._stream is None:
            return
        try:
            self._stream.send(frame)
        except StreamEndedError:
            return  # The next step gets the same error and closes the stream

    def close(self) -> None:
        """Close the stream and its descriptor."""
        if self._stream is not None:
            self._dropped += self._stream.dropped
        self._release()
        self._stream = None

    @abstractmethod
    def _release(self) -> None:
        """Close the descriptor."""

    def _transfer(self, stream: Stream, ready: frozenset[int], now: float) -> list[Arrival]:
        """Write what is queued and read what was received."""
        try:
            stream.flush()
            frames = stream.read(now, is_readable=stream.descriptor in ready)
        except StreamEndedError as error:
            self._disconnect(str(error), now)
            return []
        if frames:
            self._retry.reset()
        return [(self._address, frame) for frame in frames]

    def _disconnect(self, reason: str, now: float) -> None:
        self.close()
        self._retry.failed(now, reason)
