"""Motion JPEG over HTTP: pictures one after the other, as `multipart/x-mixed-replace`. Sans-IO.

FrameError  what a camera sends is no Motion JPEG, or a frame is too large
"""

import re
from typing import Final

LARGEST_FRAME_BYTES: Final = 2 * 1024 * 1024
_LARGEST_HEAD_BYTES: Final = 4096
_BOUNDARY: Final = re.compile(r'boundary="?([^";,\s]{1,70})"?', re.IGNORECASE)
_LENGTH: Final = re.compile(rb"(?im)^content-length:[ \t]*(\d{1,9})[ \t]*\r?$")
_EMPTY_LINES: Final = (b"\r\n\r\n", b"\n\n")
_START_OF_IMAGE: Final = b"\xff\xd8"
OUR_BOUNDARY: Final = "frame"
CONTENT_TYPE: Final = f"multipart/x-mixed-replace; boundary={OUR_BOUNDARY}"


class FrameError(Exception):
    """What a camera sends cannot be shown; the text says why."""


class FrameReader:
    """Finds the JPEGs in the bytes of one answer, however they are cut."""

    def __init__(self, content_type: str) -> None:
        """Begin at the start of an answer.

        Raises:
            FrameError: if the content type is not that of Motion JPEG.
        """
        found = _BOUNDARY.search(content_type)
        if not content_type.lower().startswith("multipart/x-mixed-replace") or found is None:
            raise FrameError(f"it sends {content_type[:80] or 'no content type'}, not Motion JPEG")
        # Some cameras write the dashes of the delimiter into the parameter too
        self._delimiter = b"--" + found[1].lstrip("-").encode("latin-1")
        self._buffer = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Take the next bytes; gives the JPEGs that are complete.

        Raises:
            FrameError: if a part is no JPEG or too large.
        """
        self._buffer += data
        frames = []
        while (frame := self._next()) is not None:
            frames.append(frame)
        return frames

    def _next(self) -> bytes | None:
        """Take one complete part off the buffer; None while there is none."""
        begin = self._buffer.find(self._delimiter)
        if begin < 0:
            if len(self._buffer) > _LARGEST_HEAD_BYTES:
                raise FrameError("it sends no delimiter between its pictures")
            return None
        head_end, body = self._head(begin + len(self._delimiter))
        if body < 0:
            if len(self._buffer) - begin > _LARGEST_HEAD_BYTES:
                raise FrameError("the head of a picture has no end")
            return None
        found = _LENGTH.search(self._buffer, begin, head_end)
        if found is not None:
            end = body + int(found[1])
        else:
            end = self._buffer.find(self._delimiter, body)
        if (len(self._buffer) if end < 0 else end) - body > LARGEST_FRAME_BYTES:
            raise FrameError(f"a picture is larger than {LARGEST_FRAME_BYTES} bytes")
        if not 0 <= end <= len(self._buffer):
            return None
        frame, self._buffer = self._buffer[body:end].rstrip(b"\r\n"), self._buffer[end:]
        if not frame.startswith(_START_OF_IMAGE):
            raise FrameError("a part is no JPEG")
        return frame

    def _head(self, start: int) -> tuple[int, int]:
        """Find the end of a part's head and the begin of its body; -1 while it is not complete."""
        end = start + _LARGEST_HEAD_BYTES
        found = [(self._buffer.find(line, start, end), len(line)) for line in _EMPTY_LINES]
        present = [(at, size) for at, size in found if at >= 0]
        if not present:
            return -1, -1
        at, size = min(present)
        return at + 1, at + size


def part_of(frame: bytes) -> bytes:
    """Encode a JPEG as the next part of an answer of `CONTENT_TYPE`."""
    head = f"--{OUR_BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(frame)}\r\n\r\n"
    return head.encode() + frame + b"\r\n"
