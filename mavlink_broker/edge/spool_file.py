"""A file that grows by whole lines and is written anew when most of it is waste.

Lines are added in one write and are on the disk when `add` returns. A process that is killed, or
a machine that stops, leaves at most a torn end, which the next one cuts off. Bytes that were
damaged cost the lines that they are in, and no other.
"""

import os
import stat
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

MOST_LINE_BYTES: Final = 4 << 20
"""Longer than any post: a picture has 1 MiB, and a third more as text."""
MOST_READ_BYTES: Final = 1 << 30
WASTE_BYTES: Final = 256 << 10
"""So much waste is left alone."""
_FLAGS: Final = os.O_RDWR | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
_MODE: Final = 0o600
_COPIED_BYTES: Final = 1 << 20
_CLOSED: Final = -1


class _Place(NamedTuple):
    """Where a line is in the file [bytes]."""

    offset: int
    length: int


class LineFile:
    """Lines by number; what has been let go of is waste until the file is written anew."""

    def __init__(self, path: Path) -> None:
        """Name the file; there is none until something is added."""
        self._path = path
        self._descriptor = _CLOSED
        self._end = 0  # Behind the last whole line
        self._places: dict[int, _Place] = {}
        self.live_bytes = 0  # Of what is held
        self.writes = 0  # How often the disk was asked to change

    def __contains__(self, number: int) -> bool:
        return number in self._places

    def __len__(self) -> int:
        return len(self._places)

    @property
    def numbers(self) -> frozenset[int]:
        """What it holds."""
        return frozenset(self._places)

    @property
    def size_bytes(self) -> int:
        """What it takes on the disk."""
        return self._end

    def read(self, number_of: Callable[[bytes], int | None]) -> None:
        """Show every line, in order, and hold those that are given a number.

        Raises:
            OSError: if it cannot be read or is no file; none at all is an empty one.
        """
        try:
            self._descriptor = _open(self._path, _FLAGS)
        except FileNotFoundError:
            return
        for offset, line in self._lines():
            number = number_of(line)
            if number is not None:
                self._places[number] = _Place(offset, len(line))
            if line.endswith(b"\n"):
                self._end = offset + len(line)
        self.live_bytes = sum(place.length for place in self._places.values())

    def _lines(self) -> Iterator[tuple[int, bytes]]:
        """Give offsets and lines; what is too long for one comes in pieces."""
        offset = 0
        with open(self._descriptor, "rb", closefd=False) as reader:
            while offset < MOST_READ_BYTES and (line := reader.readline(MOST_LINE_BYTES)):
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
        elif os.fstat(self._descriptor).st_nlink == 0:  # Somebody has removed it
            self.write_anew()
        start = self._end
        self._append(b"".join(lines.values()))
        try:
            os.fdatasync(self._descriptor)
        except OSError:
            self._cut_back(start)
            raise
        for number, line in lines.items():
            self._places[number] = _Place(start, len(line))
            start += len(line)
            self.live_bytes += len(line)

    def forget(self, numbers: Iterable[int]) -> None:
        """Hold these no longer; the disk learns of it by a word, or when it is written anew."""
        for number in numbers:
            place = self._places.pop(number, None)
            self.live_bytes -= 0 if place is None else place.length

    def let_go(self, numbers: Collection[int], word: bytes) -> None:
        """Forget lines; `word` is the line that says so to whoever reads the file.

        Raises:
            OSError: if the disk refuses; they are forgotten all the same, until it is read again.
        """
        held = len(self)
        self.forget(numbers)
        if len(self) == held:
            return
        if not self._places:
            self._cut_back(0)
        elif self._end - self.live_bytes > self.live_bytes + WASTE_BYTES:
            self.write_anew()
        else:
            self._append(word)

    def write_anew(self) -> None:
        """Leave the waste behind; a copy takes the file's place in one step.

        Raises:
            OSError: if the disk refuses; the file is then as before.
        """
        copy = self._path.with_name(self._path.name + ".new")
        copy.unlink(missing_ok=True)
        descriptor = _open(copy, _FLAGS | os.O_CREAT | os.O_EXCL)
        try:
            self.writes += 1
            places = self._copy_to(descriptor)
            os.fsync(descriptor)
            copy.replace(self._path)
        except OSError:
            os.close(descriptor)
            with suppress(OSError):
                copy.unlink()
            raise
        os.close(self._descriptor)
        self._descriptor, self._places, self._end = descriptor, places, self.live_bytes
        _sync_folder(self._path.parent)

    def clear(self) -> None:
        """Give all of its space back.

        Raises:
            OSError: if the disk refuses.
        """
        self._places, self.live_bytes = {}, 0
        self._cut_back(0)

    def close(self) -> None:
        """Let go of the file."""
        if self._descriptor != _CLOSED:
            os.close(self._descriptor)
        self._descriptor = _CLOSED

    def _append(self, words: bytes) -> None:
        """Write behind the last whole line; a torn end goes before."""
        if os.fstat(self._descriptor).st_size != self._end:
            self._cut_back(self._end)
        self.writes += 1
        try:
            _write(self._descriptor, words)
        except OSError:
            self._cut_back(self._end)
            raise
        self._end += len(words)

    def _cut_back(self, end: int) -> None:
        if self._descriptor != _CLOSED:
            self.writes += 1
            os.ftruncate(self._descriptor, end)
            self._end = end

    def _copy_to(self, descriptor: int) -> dict[int, _Place]:
        places, end = {}, 0
        for number, (offset, length) in self._places.items():
            for piece in _pieces(self._descriptor, offset, length):
                _write(descriptor, piece)
            places[number] = _Place(end, length)
            end += length
        return places


def _pieces(descriptor: int, offset: int, length: int) -> Iterator[bytes]:
    end = offset + length
    while offset < end:
        piece = os.pread(descriptor, min(_COPIED_BYTES, end - offset), offset)
        if not piece:
            raise OSError(f"the file ends before byte {end}")
        yield piece
        offset += len(piece)


def _write(descriptor: int, piece: bytes) -> None:
    written = 0
    while written < len(piece):
        written += os.write(descriptor, piece[written:])


def _open(path: Path, flags: int) -> int:
    """Open a file that is one: no link, no folder, no pipe that would never answer."""
    descriptor = os.open(path, flags, _MODE)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(f"{path} is no file")
    return descriptor


def _sync_folder(folder: Path) -> None:
    """See to it that a new name in the folder survives a loss of power."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
