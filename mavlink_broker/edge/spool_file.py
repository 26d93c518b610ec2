"""An append-only file of lines, which is compacted when most of it is obsolete.

Lines are added in one write and are on the disk when `add` returns. A process that is killed, or
a machine that stops, leaves at most a truncated last line, which the next process removes. Damaged
bytes cost the lines that contain them, and no other.
"""

import os
import stat
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

MAX_LINE_BYTES: Final = 4 << 20
"""Longer than any post: a picture has 1 MiB, and a third more as text."""
MAX_READ_BYTES: Final = 1 << 30
OBSOLETE_BYTES: Final = 256 << 10
"""Up to so many obsolete bytes are no reason to compact."""
_FLAGS: Final = os.O_RDWR | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
_MODE: Final = 0o600
_COPIED_BYTES: Final = 1 << 20
_CLOSED: Final = -1


class _Extent(NamedTuple):
    """Where a line is in the file [bytes]."""

    offset: int
    length: int


class LineFile:
    """Lines by number; discarded lines are obsolete and stay in the file until it is compacted."""

    def __init__(self, path: Path) -> None:
        """Name the file; it is created with the first line."""
        self._path = path
        self._descriptor = _CLOSED
        self._end = 0  # Of the last complete line
        self._extents: dict[int, _Extent] = {}
        self.live_bytes = 0  # Of the lines that are not obsolete
        self.writes = 0  # Number of changes to the file

    def __contains__(self, number: int) -> bool:
        return number in self._extents

    def __len__(self) -> int:
        return len(self._extents)

    @property
    def numbers(self) -> frozenset[int]:
        """The numbers of its lines."""
        return frozenset(self._extents)

    @property
    def size_bytes(self) -> int:
        """Its size on the disk."""
        return self._end

    def read(self, number_of: Callable[[bytes], int | None]) -> None:
        """Pass every line to `number_of`, in order, and keep those that get a number.

        Raises:
            OSError: if it cannot be read or is not a regular file; a missing file is empty.
        """
        try:
            self._descriptor = _open(self._path, _FLAGS)
        except FileNotFoundError:
            return
        for offset, line in self._lines():
            number = number_of(line)
            if number is not None:
                self._extents[number] = _Extent(offset, len(line))
            if line.endswith(b"\n"):
                self._end = offset + len(line)
        self.live_bytes = sum(extent.length for extent in self._extents.values())

    def _lines(self) -> Iterator[tuple[int, bytes]]:
        """Give offsets and lines; a line that is too long comes in pieces."""
        offset = 0
        with open(self._descriptor, "rb", closefd=False) as reader:
            while offset < MAX_READ_BYTES and (line := reader.readline(MAX_LINE_BYTES)):
                yield offset, line
                offset += len(line)

    def add(self, lines: Mapping[int, bytes]) -> None:
        """Add lines, all of them or none, safe against a loss of power.

        Raises:
            OSError: if the disk refuses; the file then ends as before.
        """
        if self._descriptor == _CLOSED:
            self._descriptor = _open(self._path, _FLAGS | os.O_CREAT | os.O_EXCL)
            _sync_folder(self._path.parent)
        elif os.fstat(self._descriptor).st_nlink == 0:  # Another program has removed the file
            self.compact()
        start = self._end
        self._append(b"".join(lines.values()))
        try:
            os.fdatasync(self._descriptor)
        except OSError:
            self._truncate(start)
            raise
        for number, line in lines.items():
            self._extents[number] = _Extent(start, len(line))
            start += len(line)
            self.live_bytes += len(line)

    def discard(self, numbers: Iterable[int]) -> None:
        """Make lines obsolete in memory; on the disk a note or a compaction does so."""
        for number in numbers:
            extent = self._extents.pop(number, None)
            self.live_bytes -= 0 if extent is None else extent.length

    def release(self, numbers: Collection[int], note: bytes) -> None:
        """Make lines obsolete, also on the disk; `note` is the line that says so to a reader.

        Raises:
            OSError: if the disk refuses; they are obsolete until the file is read again.
        """
        before = len(self)
        self.discard(numbers)
        if len(self) == before:
            return
        if not self._extents:
            self._truncate(0)
        elif self._end - self.live_bytes > self.live_bytes + OBSOLETE_BYTES:
            self.compact()
        else:
            self._append(note)

    def compact(self) -> None:
        """Write a copy without obsolete bytes, which replaces the file in one step.

        Raises:
            OSError: if the disk refuses; the file is then as before.
        """
        copy = self._path.with_name(self._path.name + ".new")
        copy.unlink(missing_ok=True)
        descriptor = _open(copy, _FLAGS | os.O_CREAT | os.O_EXCL)
        try:
            self.writes += 1
            extents = self._copy_to(descriptor)
            os.fsync(descriptor)
            copy.replace(self._path)
        except OSError:
            os.close(descriptor)
            with suppress(OSError):
                copy.unlink()
            raise
        os.close(self._descriptor)
        self._descriptor, self._extents, self._end = descriptor, extents, self.live_bytes
        _sync_folder(self._path.parent)

    def clear(self) -> None:
        """Remove all lines and free their space.

        Raises:
            OSError: if the disk refuses.
        """
        self._extents, self.live_bytes = {}, 0
        self._truncate(0)

    def close(self) -> None:
        """Close the file."""
        if self._descriptor != _CLOSED:
            os.close(self._descriptor)
        self._descriptor = _CLOSED

    def _append(self, data: bytes) -> None:
        """Write after the last complete line; an incomplete one is removed first."""
        if os.fstat(self._descriptor).st_size != self._end:
            self._truncate(self._end)
        self.writes += 1
        try:
            _write(self._descriptor, data)
        except OSError:
            self._truncate(self._end)
            raise
        self._end += len(data)

    def _truncate(self, end: int) -> None:
        if self._descriptor != _CLOSED:
            self.writes += 1
            os.ftruncate(self._descriptor, end)
            self._end = end

    def _copy_to(self, descriptor: int) -> dict[int, _Extent]:
        extents, end = {}, 0
        for number, (offset, length) in self._extents.items():
            for piece in _pieces(self._descriptor, offset, length):
                _write(descriptor, piece)
            extents[number] = _Extent(end, length)
            end += length
        return extents


def _pieces(descriptor: int, offset: int, length: int) -> Iterator[bytes]:
    end = offset + length
    while offset < end:
        piece = os.pread(descriptor, min(_COPIED_BYTES, end - offset), offset)
        if not piece:
            raise OSError(f"the file ends before byte {end}")
        yield piece
        offset += len(piece)


def _write(descriptor: int, data: bytes) -> None:
    written = 0
    while written < len(data):
        written += os.write(descriptor, data[written:])


def _open(path: Path, flags: int) -> int:
    """Open a regular file; a link, folder or pipe is refused (opening a pipe could block)."""
    descriptor = os.open(path, flags, _MODE)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(f"{path} is not a regular file")
    return descriptor


def _sync_folder(folder: Path) -> None:
    """Make a new name in the folder survive a loss of power."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
