"""Whole frames out of a stream of bytes that may begin, end and break anywhere."""

from typing import Final

from mavlink_broker.mavlink.frames import checksum_holds, frame_size, next_marker

COMPLETE_WITHIN_S: Final = 1.0
"""What has not become a frame by then was none: noise that looked like a frame's first byte.

The longest frame takes 0.3 s at 9600 baud. Without this a first byte out of nothing would swallow
the next 280 bytes of a quiet line.
"""


class FrameScanner:
    """Carries over what a read has left incomplete; never keeps more than one frame's length.

    Only frames whose checksum holds are given out, so that noise costs no frame behind it. Of
    messages that the dialect lacks it cannot be known; they pass where the next frame, or
    nothing, follows them.
    """

    def __init__(self) -> None:
        self._rest = b""
        self._began_at = 0.0
        self.skipped = 0  # Bytes that belonged to no frame

    @property
    def is_waiting(self) -> bool:
        """Whether a frame has begun and not ended."""
        return bool(self._rest)

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Take what was read, nothing included; gives the frames that are whole."""
        if not data and not self._rest:
            return []
        frames: list[bytes] = []
        if self._rest and now - self._began_at > COMPLETE_WITHIN_S:
            frames += self._scan(self._rest, give_up=True)
        if not self._rest:
            self._began_at = now
        if data:
            before = len(self._rest)
            frames += self._scan(self._rest + data, give_up=False)
            if len(self._rest) <= len(data) or not before:
                self._began_at = now
        return frames

    def _scan(self, data: bytes, *, give_up: bool) -> list[bytes]:
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
                if not give_up:
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
