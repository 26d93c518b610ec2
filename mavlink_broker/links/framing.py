"""Finds whole MAVLink frames in a stream of bytes that may start, end and break anywhere."""

from typing import Final

from mavlink_broker.mavlink.frames import checksum_holds, frame_size, next_marker

FRAME_TIMEOUT_S: Final = 1.0
"""Bytes that are not a whole frame by then are noise that looked like a frame's first byte.

The longest frame takes 0.3 s at 9600 baud. Without this limit a stray start byte would swallow the
next 280 bytes of a quiet line.
"""


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
