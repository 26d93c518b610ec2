"""One open byte stream: finds frames in what is read, queues whole frames to be sent.

Reading and writing never block. Frames that the other side does not take are queued; a full queue
drops its oldest whole frames, because only the newest are up to date.
"""

import os
from collections import deque
from typing import Final

from mavlink_broker.links.framing import FrameScanner
from mavlink_broker.links.rate_limit import RateLimiter

MAX_READ_BYTES: Final = 16_384
"""Limit of one read, so that a flood cannot block the loop."""
QUEUE_BYTES: Final = 8192
"""Queue size: 1.4 s of a radio at 57,600 baud."""


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
        self.is_proven = False  # A whole frame has come

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
        frames = self._scanner.feed(data, now)
        self.is_proven |= bool(frames)
        return frames

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
