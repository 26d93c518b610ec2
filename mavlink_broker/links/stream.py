"""One open byte stream: finds frames in what is read, queues whole frames to be sent.

Reading and writing never block. Frames that the other side does not take are queued; a full queue
drops its oldest whole frames, because only the newest are up to date.

`FrameScanner` finds whole frames in bytes that may start, end and break anywhere. `SinglePeerLink`
is what a serial line and an outgoing TCP connection share: one stream, one peer.

"""

import os
from abc import ABC, abstractmethod
from collections import deque
from typing import Final

from mavlink_broker.links.link import Arrival, RateLimiter, RetryTimer
from mavlink_broker.links.url import Address, LinkUrl
from mavlink_broker.mavlink.codec import checksum_holds, frame_size, next_marker

FRAME_TIMEOUT_S: Final = 1.0
"""Bytes that are not a whole frame by then are noise that looked like a frame's first byte.

The longest frame takes 0.3 s at 9600 baud. Without this limit a stray start byte would swallow the
next 280 bytes of a quiet line.
"""
MAX_READ_BYTES: Final = 16_384
"""Limit of one read, so that a flood cannot block the loop."""
QUEUE_BYTES: Final = 8192
"""Queue size: 1.4 s of a radio at 57,600 baud."""


class FrameScanner:
    """Keeps the incomplete end of a read, never more than one frame's length.

    Returns only frames with a correct checksum, so that noise costs no frame after it. The checksum
    of a message that the dialect does not know cannot be checked; such a frame is returned if
    another frame, or nothing, follows it.
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
        if not data and not self._rest:
            return []
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
        frames: list[bytes] = []
        position = 0
        while True:
            start = next_marker(data, position)
            self.skipped += start - position
            if start == len(data):
                self._rest = b""
                return frames
            size = frame_size(data, start)
            if size is None or start + size > len(data):
                if not is_expired:
                    self._rest = data[start:]
                    return frames
                size = 0
            position = start + (size if size and _is_frame(data, start, size) else 0)
            if position > start:
                frames.append(data[start:position])
            else:
                position = start + 1
                self.skipped += 1


def _is_frame(data: bytes, start: int, size: int) -> bool:
    end = start + size
    holds = checksum_holds(data[start:end])
    if holds is None:
        return end == len(data) or next_marker(data, end) == end
    return holds


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
    def skipped(self) -> int:
        """Number of bytes outside of any frame."""
        return self._scanner.skipped

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


class SinglePeerLink(ABC):
    """A stream that may open and close again; the subclass opens it."""

    def __init__(self, url: LinkUrl, number: int, retry: RetryTimer) -> None:
        self.url = url
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
