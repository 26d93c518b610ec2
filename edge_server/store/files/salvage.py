"""Reads rows from the raw pages of a SQLite file and its log, without its schema; pure.

A table's rows are in leaf pages that do not name their table and can be read without the pages
above them (SQLite file format, sections 1.6 and 2). So a damaged schema, root or first page loses
no row; only a damaged leaf does. A row may be found twice, or be a deleted one; the caller must
check it, or read only the newest copies of the pages in use (`live_rows`).
"""

import mmap
import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple, TypeAlias

Value: TypeAlias = int | float | str | bytes | None
Content: TypeAlias = bytes | mmap.mmap
DEFAULT_PAGE_BYTES: Final = 4096
_LEAF: Final = 0x0D
_FREELIST_AT: Final = 32
_FILE_HEADER_BYTES: Final = 100
_LOG_HEADER_BYTES: Final = 32
_FRAME_HEADER_BYTES: Final = 24
_INTEGER_BYTES: Final = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}
_MOST_PAYLOAD_BYTES: Final = 16 * 1024 * 1024


class Row(NamedTuple):
    """A row of some table."""

    rowid: int
    values: Sequence[Value]


class _DamagedError(Exception):
    """A cell that is none."""


def rows(file: Content, log: bytes = b"") -> Iterator[Row]:
    """Find the rows of all tables in a file and in the log of changes beside it."""
    size = _page_size(file)
    frames = list(_frames(log, size))
    pages = dict(frames)
    for number, page in [*_pages(file, size), *reversed(frames)]:
        offset = _FILE_HEADER_BYTES if number == 1 else 0
        if len(page) == size and page[offset] == _LEAF:
            yield from _leaf(page, offset, _Overflow(file, pages, size))


def live_rows(file: Content, log: bytes = b"") -> Iterator[Row]:
    """Find the rows of all tables in the newest copies of those pages that are in use.

    Where the list of free pages is damaged, what was deleted with its page is among them.
    """
    size = _page_size(file)
    newest = dict(_frames(log, size))
    number_of_pages = max(len(file) // size, *newest, 0)
    overflow = _Overflow(file, newest, size)
    free = _free_pages(overflow, number_of_pages)
    for number in range(1, number_of_pages + 1):
        page = overflow.page(number)
        offset = _FILE_HEADER_BYTES if number == 1 else 0
        if number not in free and len(page) == size and page[offset] == _LEAF:
            yield from _leaf(page, offset, overflow)


def _free_pages(pages: "_Overflow", number_of_pages: int) -> set[int]:
    """Follow the list of free pages (section 1.5) as far as it goes."""
    found: set[int] = set()
    trunk = int.from_bytes(pages.page(1)[_FREELIST_AT : _FREELIST_AT + 4], "big")
    while 0 < trunk <= number_of_pages and trunk not in found:
        page = pages.page(trunk)
        if len(page) != pages.page_bytes:
            break
        found.add(trunk)
        trunk, count = struct.unpack_from(">II", page)
        leaves = min(count, pages.page_bytes // 4 - 2)
        found.update(struct.unpack_from(f">{leaves}I", page, 8))
    return found


def _page_size(file: Content) -> int:
    stated = int.from_bytes(file[16:18], "big")
    is_one = 512 <= stated <= 32_768 and stated & (stated - 1) == 0
    return stated if is_one else DEFAULT_PAGE_BYTES


def _pages(file: Content, size: int) -> Iterator[tuple[int, bytes]]:
    for start in range(0, len(file), size):
        yield start // size + 1, file[start : start + size]


def _frames(log: bytes, size: int) -> Iterator[tuple[int, bytes]]:
    """Give the pages in a log that belong to its present round (section 4.1), sound or not."""
    salts = log[16:24]
    for start in range(_LOG_HEADER_BYTES, len(log), _FRAME_HEADER_BYTES + size):
        header = log[start : start + _FRAME_HEADER_BYTES]
        if len(header) == _FRAME_HEADER_BYTES and header[8:16] == salts:
            place = start + _FRAME_HEADER_BYTES
            yield int.from_bytes(header[:4], "big"), log[place : place + size]


class _Overflow(NamedTuple):
    """Where the rest of a long row is: in the log's newest copy of a page, else in the file."""

    file: Content
    log_pages: Mapping[int, bytes]
    page_bytes: int

    def page(self, number: int) -> bytes:
        """Give the newest copy of a page; too short where there is none."""
        start = (number - 1) * self.page_bytes
        return self.log_pages.get(number) or self.file[start : start + self.page_bytes]

    def read(self, number: int, left: int) -> bytes:
        """Follow a chain of overflow pages; raises _DamagedError."""
        content = bytearray()
        while left > 0:
            page = self.page(number)
            if number < 1 or len(page) != self.page_bytes:
                raise _DamagedError
            content += page[4 : 4 + left]
            left -= self.page_bytes - 4
            number = int.from_bytes(page[:4], "big")
        return bytes(content)


def _leaf(page: bytes, offset: int, overflow: _Overflow) -> Iterator[Row]:
    (count,) = struct.unpack_from(">H", page, offset + 3)
    for place in range(offset + 8, min(offset + 8 + 2 * count, len(page) - 1), 2):
        (cell,) = struct.unpack_from(">H", page, place)
        try:
            yield _cell(page, cell, overflow)
        except (_DamagedError, IndexError, struct.error, UnicodeDecodeError):
            continue


def _cell(page: bytes, start: int, overflow: _Overflow) -> Row:
    size, place = _varint(page, start)
    rowid, place = _varint(page, place)
    if not 0 < size <= _MOST_PAYLOAD_BYTES:
        raise _DamagedError
    local = _local_bytes(size, overflow.page_bytes)
    content = page[place : place + local]
    if len(content) != local:
        raise _DamagedError
    if local < size:
        first = int.from_bytes(page[place + local : place + local + 4], "big")
        content += overflow.read(first, size - local)
    return Row(rowid - 2**64 if rowid >= 2**63 else rowid, _record(content))


def _local_bytes(size: int, page_bytes: int) -> int:
    """How much of a row stands in its leaf page (section 1.6)."""
    most = page_bytes - 35
    if size <= most:
        return size
    least = (page_bytes - 12) * 32 // 255 - 23
    kept = least + (size - least) % (page_bytes - 4)
    return kept if kept <= most else least


def _record(content: bytes) -> list[Value]:
    """Read the record format (section 2.1)."""
    header_bytes, place = _varint(content, 0)
    types = []
    while place < header_bytes:
        kind, place = _varint(content, place)
        types.append(kind)
    found: list[Value] = []
    for kind in types:
        value, place = _value(content, place, kind)
        found.append(value)
    if place != len(content):
        raise _DamagedError
    return found


def _value(content: bytes, place: int, kind: int) -> tuple[Value, int]:
    if kind == 0:
        return None, place
    if kind in {8, 9}:
        return kind - 8, place
    size = _INTEGER_BYTES.get(kind, 8 if kind == 7 else (kind - 12) // 2)
    raw = content[place : place + size]
    if len(raw) != size or kind in {10, 11}:
        raise _DamagedError
    value: Value = raw
    if kind in _INTEGER_BYTES:
        value = int.from_bytes(raw, "big", signed=True)
    elif kind == 7:
        (value,) = struct.unpack(">d", raw)
    elif kind % 2:
        value = raw.decode()
    return value, place + size


def _varint(content: bytes, place: int) -> tuple[int, int]:
    """Read an integer of 1 to 9 bytes; returns it and the place behind it."""
    value = 0
    for _ in range(8):
        byte = content[place]
        place += 1
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, place
    return value << 8 | content[place], place + 1
