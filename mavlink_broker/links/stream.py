"""One open stream of bytes: frames come out of what is read, whole frames go into what is sent.

Reading and writing never wait. What the other side does not take in time waits here; when too
much does, the oldest whole frames are given up, because the newest are what is still true.
"""

import os
from collections import deque
from typing import Final

from mavlink_broker.links.framing import FrameScanner
from mavlink_broker.links.pace import Pace

READ_AT_ONCE: Final = 16_384
"""So that a flood cannot keep the loop from its other duties."""
QUEUE_BYTES: Final = 8192
"""What may wait to be sent: 1.4 s of a radio at 57,600 baud."""


class StreamEndedError(Exception):
    """The other side is gone; the text says how that showed."""


class Stream:
    """A descriptor that does not block."""

    def __init__(
        self, descriptor: int, queue_bytes: int = QUEUE_BYTES, pace: Pace | None = None
    ) -> None:
        """Use an open descriptor, and write no faster than `pace` allows."""
        self._pace = pace
        self._is_held = False
        self._now = 0.0
        self.descriptor = descriptor
        self._scanner = FrameScanner()
        self._queue: deque[bytes] = deque()
        self._queued = 0
        self._queue_bytes = queue_bytes
        self._begun = False  # The first of the queue has left in part
        self.dropped = 0  # Frames
        self.is_proven = False  # A whole frame has come

    @property
    def skipped(self) -> int:
        """Bytes that belonged to no frame."""
        return self._scanner.skipped

    @property
    def is_behind(self) -> bool:
        """Whether something waits for room."""
        return bool(self._queue) and not self._is_held

    def read(self, now: float, *, is_readable: bool = True) -> list[bytes]:
        """Give the frames that have become whole.

        Raises:
            StreamEndedError: if the other side is gone.
        """
        self._now = now
        data = self._bytes() if is_readable else b""
        frames = self._scanner.feed(data, now)
        self.is_proven |= bool(frames)
        return frames

    def send(self, frame: bytes) -> None:
        """Send a frame, now or when there is room.

        Raises:
            StreamEndedError: if the other side is gone.
        """
        self._queue.append(frame)
        self._queued += len(frame)
        self.flush()
        while self._queued > self._queue_bytes:
            self._give_up_oldest()

    def flush(self) -> None:
        """Send what waits, as far as there is room.

        Raises:
            StreamEndedError: if the other side is gone.
        """
        while self._queue:
            self._is_held = self._pace is not None and not self._pace.allows(self._now)
            if self._is_held:
                return
            frame = self._queue[0]
            try:
                sent = os.write(self.descriptor, frame)
            except BlockingIOError:
                return
            except OSError as error:
                raise StreamEndedError(error.strerror or str(error)) from error
            if self._pace is not None:
                self._pace.wrote(sent)
            self._queued -= sent
            self._begun = sent < len(frame)
            if self._begun:
                self._queue[0] = frame[sent:]
                return
            self._queue.popleft()

    def _give_up_oldest(self) -> None:
        """Drop a frame, but none that has begun: half a frame would spoil the next one too."""
        begun = [self._queue.popleft()] if self._begun else []
        self._queued -= len(self._queue.popleft())
        self._queue.extendleft(begun)
        self.dropped += 1

    def _bytes(self) -> bytes:
        try:
            data = os.read(self.descriptor, READ_AT_ONCE)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise StreamEndedError(error.strerror or str(error)) from error
        if not data:
            raise StreamEndedError("the other side has closed it")
        return data
