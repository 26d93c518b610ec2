"""A partly received file with sorted ranges of missing bytes, and the outcome of a download."""

import math
import zlib
from bisect import bisect_right
from collections.abc import Iterator
from typing import Final, NamedTuple, TypeAlias

_ALL_ONES: Final = 0xFFFFFFFF


class Fetched(NamedTuple):
    """The whole file."""

    data: bytes


class NotFetched(NamedTuple):
    """Why the download has failed."""

    reason: str


FetchOutcome: TypeAlias = Fetched | NotFetched


class MissingRanges:
    """The missing part of a file of a known size."""

    def __init__(self, size: int) -> None:
        self._ranges: list[tuple[int, int]] = [(0, size)] if size else []

    def __bool__(self) -> bool:
        return bool(self._ranges)

    def __contains__(self, offset: int) -> bool:
        """Whether the byte at an offset is missing."""
        index = bisect_right(self._ranges, (offset, math.inf)) - 1
        return index >= 0 and self._ranges[index][0] <= offset < self._ranges[index][1]

    @property
    def count(self) -> int:
        """How many bytes are missing."""
        return sum(end - start for start, end in self._ranges)

    def pieces(self, largest: int) -> Iterator[tuple[int, int]]:
        """Iterate over the gaps in pieces (offset, size) of at most `largest` bytes."""
        for start, end in self._ranges:
            for offset in range(start, end, largest):
                yield offset, min(largest, end - offset)

    def first_gap(self, least: int, position: int) -> int | None:
        """Start of a gap of at least `least` bytes: after `position`, else the first one.

        A gap across the position is cut there.
        """
        wide = [(start, end) for start, end in self._ranges if end - start >= least]
        for start, end in wide:
            if end - max(start, position) >= least:
                return max(start, position)
        return wide[0][0] if wide else None

    def remove(self, start: int, end: int) -> bool:
        """Remove received bytes; true if any of them was missing."""
        if start >= end:
            return False
        index = max(0, bisect_right(self._ranges, (start, end)) - 1)
        kept: list[tuple[int, int]] = []
        touched = index
        while touched < len(self._ranges) and self._ranges[touched][0] < end:
            gap_begin, gap_end = self._ranges[touched]
            kept += [(gap_begin, min(gap_end, start))] if gap_begin < start else []
            kept += [(max(gap_begin, end), gap_end)] if gap_end > end else []
            touched += 1
        before = self._ranges[index:touched]
        self._ranges[index:touched] = kept
        return kept != before


class PartialFile:
    """The bytes of a file, and which of them are missing."""

    def __init__(self, size: int) -> None:
        self._data = bytearray(size)
        self.missing = MissingRanges(size)

    @property
    def size(self) -> int:
        """Size of the whole file."""
        return len(self._data)

    @property
    def received(self) -> int:
        """Number of received bytes."""
        return self.size - self.missing.count

    @property
    def data(self) -> bytes:
        """The bytes; missing ones are zero."""
        return bytes(self._data)

    def write(self, offset: int, data: bytes) -> bool:
        """Store bytes up to the end of the file; true if any of them was missing."""
        end = min(offset + len(data), self.size)
        is_new = offset < end and self.missing.remove(offset, end)
        if is_new:
            self._data[offset:end] = data[: end - offset]
        return is_new

    @property
    def checksum(self) -> int:
        """CRC32 as MAVFTP servers compute it: starts at zero, not inverted at the end."""
        return zlib.crc32(self._data, _ALL_ONES) ^ _ALL_ONES
