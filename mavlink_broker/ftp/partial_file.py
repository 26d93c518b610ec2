"""A file of which some bytes have come: what is missing are sorted ranges that shrink.

And what becomes of it in the end.
"""

import math
import zlib
from bisect import bisect_right
from collections.abc import Iterator
from typing import Final, NamedTuple, TypeAlias

_ALL_ONES: Final = 0xFFFFFFFF


class Fetched(NamedTuple):
    """The file, whole."""

    data: bytes


class NotFetched(NamedTuple):
    """Why it could not be had."""

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
        return sum(end - begin for begin, end in self._ranges)

    def pieces(self, largest: int) -> Iterator[tuple[int, int]]:
        """Give the gaps, cut into pieces (offset, size) of at most so many bytes."""
        for begin, end in self._ranges:
            for offset in range(begin, end, largest):
                yield offset, min(largest, end - offset)

    def first_wide(self, least: int, position: int) -> int | None:
        """Give where a gap of at least so many bytes begins: from a position on, else the first.

        A gap that reaches across the position is cut there.
        """
        wide = [(begin, end) for begin, end in self._ranges if end - begin >= least]
        for begin, end in wide:
            if end - max(begin, position) >= least:
                return max(begin, position)
        return wide[0][0] if wide else None

    def remove(self, begin: int, end: int) -> bool:
        """Take that these bytes have come; whether any of them was missing."""
        if begin >= end:
            return False
        index = max(0, bisect_right(self._ranges, (begin, end)) - 1)
        kept: list[tuple[int, int]] = []
        touched = index
        while touched < len(self._ranges) and self._ranges[touched][0] < end:
            gap_begin, gap_end = self._ranges[touched]
            kept += [(gap_begin, min(gap_end, begin))] if gap_begin < begin else []
            kept += [(max(gap_begin, end), gap_end)] if gap_end > end else []
            touched += 1
        before = self._ranges[index:touched]
        self._ranges[index:touched] = kept
        return kept != before


class PartialFile:
    """The bytes of a file, and which of them are still missing."""

    def __init__(self, size: int) -> None:
        self._data = bytearray(size)
        self.missing = MissingRanges(size)

    @property
    def size(self) -> int:
        """Of the whole file."""
        return len(self._data)

    @property
    def received(self) -> int:
        """How many bytes have come."""
        return self.size - self.missing.count

    @property
    def data(self) -> bytes:
        """The bytes, zero where they are missing."""
        return bytes(self._data)

    def keep(self, offset: int, data: bytes) -> bool:
        """Take some bytes; whether any of them was missing. What lies behind the end is dropped."""
        end = min(offset + len(data), self.size)
        is_news = offset < end and self.missing.remove(offset, end)
        if is_news:
            self._data[offset:end] = data[: end - offset]
        return is_news

    @property
    def checksum(self) -> int:
        """CRC32 as file servers compute it: begun at zero and not inverted at the end."""
        return zlib.crc32(self._data, _ALL_ONES) ^ _ALL_ONES
