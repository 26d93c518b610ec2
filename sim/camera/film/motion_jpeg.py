"""Films as Motion JPEG in AVI: every frame a whole JPEG, played by everything that plays films.

RIFF AVI 1.0 (Microsoft, "AVI RIFF File Reference"): a header list, the frames as `00dc` chunks in
a `movi` list, and an index behind them. The header is written again with each frame, so that a
film whose end never came plays up to its last whole frame.

Errors:
    FilmFullError(OSError): the file has reached what its format can hold.
"""

import errno
import struct
from typing import BinaryIO, Final

LARGEST_BYTES: Final = 1 << 30
"""AVI 1.0 players count in 31 bits; at 40 KiB a frame and 5 Hz this is an hour and a half."""
_HAS_INDEX: Final = 0x10
_KEY_FRAME: Final = 0x10
_MICROSECONDS_PER_SECOND: Final = 1_000_000
_RATE_SCALE: Final = 1000  # Rates are written in thousandths of a hertz
_DEFAULT_QUALITY: Final = 0xFFFF_FFFF
_INDEX_ENTRY: Final = struct.Struct("<4sIII")


class FilmFullError(OSError):
    """The file has reached what its format can hold."""


class Film:
    """A film that is being written to an empty file."""

    def __init__(self, file: BinaryIO, width_px: int, height_px: int, rate_hz: float) -> None:
        self._file = file
        self._size_px = (width_px, height_px)
        self._rate_hz = rate_hz
        self._index: list[tuple[int, int]] = []  # Offset in the list, size
        self._movi_bytes = 4
        self._largest = 0
        self._last = b""
        self._file.write(self._header(has_index=False))

    @property
    def frames(self) -> int:
        """How many there are."""
        return len(self._index)

    def add(self, jpeg: bytes) -> int:
        """Append a frame; gives by how much the film has grown [B].

        Raises:
            FilmFullError: if no more fits; the film is as it was.
            OSError: if the storage refuses.
        """
        chunk = b"00dc" + struct.pack("<I", len(jpeg)) + jpeg + b"\0" * (len(jpeg) % 2)
        end = len(self._header(has_index=False)) - 4 + self._movi_bytes
        if end + len(chunk) + _INDEX_ENTRY.size * (self.frames + 1) > LARGEST_BYTES:
            raise FilmFullError(errno.EFBIG, "the video has reached the limit of its format")
        self._file.seek(end)
        self._file.write(chunk)
        self._index.append((self._movi_bytes, len(jpeg)))
        self._movi_bytes += len(chunk)
        self._largest = max(self._largest, len(jpeg))
        self._last = jpeg
        self._write_header(has_index=False)
        return len(chunk)

    def extend(self, frames: int) -> int:
        """Show the last frame until there are so many; gives by how much the film has grown [B].

        A film without a frame stays empty.

        Raises:
            FilmFullError: if no more fits; those that did are there.
            OSError: if the storage refuses.
        """
        grown = 0
        while self._last and self.frames < frames:
            grown += self.add(self._last)
        return grown

    def close(self) -> int:
        """Write the index and close the file; gives by how much the film has grown [B]."""
        entries = b"".join(
            _INDEX_ENTRY.pack(b"00dc", _KEY_FRAME, offset, size) for offset, size in self._index
        )
        index = _chunk(b"idx1", entries)
        try:
            self._file.seek(len(self._header(has_index=True)) - 4 + self._movi_bytes)
            self._file.write(index)
            self._write_header(has_index=True, more_bytes=len(index))
        finally:
            self._file.close()
        return len(index)

    def _write_header(self, *, has_index: bool, more_bytes: int = 0) -> None:
        self._file.seek(0)
        self._file.write(self._header(has_index=has_index, more_bytes=more_bytes))
        self._file.flush()

    def _header(self, *, has_index: bool, more_bytes: int = 0) -> bytes:
        """Everything before the first frame; always of the same length."""
        stream = _list(b"strl", _chunk(b"strh", self._stream()) + _chunk(b"strf", self._format()))
        head = _list(b"hdrl", _chunk(b"avih", self._main(has_index=has_index)) + stream)
        movi = b"LIST" + struct.pack("<I", self._movi_bytes) + b"movi"
        riff_bytes = 4 + len(head) + 8 + self._movi_bytes + more_bytes
        return b"RIFF" + struct.pack("<I", riff_bytes) + b"AVI " + head + movi

    def _main(self, *, has_index: bool) -> bytes:
        """AVIMAINHEADER."""
        return struct.pack(
            "<14I",
            round(_MICROSECONDS_PER_SECOND / self._rate_hz),
            round(self._largest * self._rate_hz),
            0,
            _HAS_INDEX if has_index else 0,
            self.frames,
            0,
            1,
            self._largest,
            *self._size_px,
            *(0, 0, 0, 0),
        )

    def _stream(self) -> bytes:
        """AVISTREAMHEADER."""
        rate = round(self._rate_hz * _RATE_SCALE)
        return struct.pack(
            "<4s4sIHHIIIIIIII4h",
            b"vids",
            b"MJPG",
            *(0, 0, 0, 0),
            _RATE_SCALE,
            rate,
            0,
            self.frames,
            self._largest,
            _DEFAULT_QUALITY,
            0,
            *(0, 0, *self._size_px),
        )

    def _format(self) -> bytes:
        """BITMAPINFOHEADER."""
        width, height = self._size_px
        return struct.pack(
            "<IiiHH4sIiiII", 40, width, height, 1, 24, b"MJPG", 3 * width * height, 0, 0, 0, 0
        )


def _chunk(name: bytes, content: bytes) -> bytes:
    return name + struct.pack("<I", len(content)) + content


def _list(name: bytes, content: bytes) -> bytes:
    return _chunk(b"LIST", name + content)
