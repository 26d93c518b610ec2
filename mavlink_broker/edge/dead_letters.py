"""Dead letters: posts that the edge server never takes, kept on disk until somebody decides.

A post that is refused for good would be refused again, and one that fails again and again while
others are answered holds up everything behind it. Either is taken out of its line, kept here with
the reason, and sent again or removed by a person: `python -m mavlink_broker dead-letters`. That
command only reads the file; what it asks for goes into a file beside it, which the broker carries
out, the running one or the next. The broker renames that file before it reads it, and removes it
when all of it is done: an order that comes meanwhile begins a new file, and one that a killed
broker has begun is carried out by the next.
"""

import fcntl
import logging
import os
import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

from mavlink_broker.edge.outbox import DeadLetter, Post
from mavlink_broker.edge.spool_file import LineFile
from mavlink_broker.edge.spool_record import RecordError, line_of_dead, read_dead

DEAD: Final = "spool.dead"
ORDERS: Final = "spool.dead.orders"
TAKEN: Final = "spool.dead.orders.taken"
"""Orders that are being carried out."""
_ORDER: Final = re.compile(rb"(retry|drop) ([0-9]{1,16})\n?")
_LINE_BYTES: Final = 64
"""More than the longest order has."""

_LOG = logging.getLogger(__name__)


class Kept(NamedTuple):
    """A dead letter under its number."""

    number: int
    letter: DeadLetter


class Orders(NamedTuple):
    """What a person wants done with dead letters, by number."""

    retry: frozenset[int] = frozenset()
    drop: frozenset[int] = frozenset()


class DeadLetters:
    """The dead letters of one broker; who has the spool's folder has them."""

    def __init__(self, folder: Path, most_bytes: int) -> None:
        """Read what is there.

        Raises:
            OSError: if it cannot be read.
        """
        self._orders = folder / ORDERS
        self._taken = folder / TAKEN
        self._most_bytes = most_bytes
        self._file = LineFile(folder / DEAD)
        self._letters: dict[int, DeadLetter] = {}
        self._file.read(self._number_of)

    @property
    def of_vehicles(self) -> dict[int, int]:
        """How many there are of each vehicle."""
        counts: dict[int, int] = {}
        for letter in self._letters.values():
            vehicle_id = letter.post.vehicle_id
            counts[vehicle_id] = counts.get(vehicle_id, 0) + 1
        return counts

    def __contains__(self, number: int) -> bool:
        return number in self._letters

    def add(self, number: int, letter: DeadLetter) -> None:
        """Keep one; the oldest go where there is no room.

        Raises:
            OSError: if the disk refuses.
        """
        line = line_of_dead(number, letter)
        while self._letters and self._file.live_bytes + len(line) > self._most_bytes:
            oldest = min(self._letters)
            _LOG.error("dead letter %d is given up: there is no room", oldest)
            self.remove({oldest})
        if self._file.size_bytes + len(line) > self._most_bytes and self._letters:
            self._file.write_anew()
        self._file.add({number: line})
        self._letters[number] = letter

    def get(self, number: int) -> Post | None:
        """Give one to be sent again; it stays until it is removed."""
        letter = self._letters.get(number)
        if letter is None:
            return None
        return replace(letter.post, attempts=0, may_be_known=True, kept_as=None, is_inherited=True)

    def remove(self, numbers: Collection[int]) -> None:
        """Forget some.

        Raises:
            OSError: if the disk refuses; they come back with the next run.
        """
        for number in numbers:
            self._letters.pop(number, None)
        self._file.forget(numbers)
        if self._letters:
            self._file.write_anew()
        else:
            self._file.clear()

    @property
    def highest(self) -> int:
        """The highest number of a dead letter; 0 without any."""
        return max(self._letters, default=0)

    def take_orders(self) -> Orders:
        """Read what a person has asked for; nothing, if nothing. `end_orders` removes it.

        Raises:
            OSError: if there is something that cannot be read, or is still being written.
        """
        try:
            if not self._taken.exists():
                self._orders.rename(self._taken)
            file = self._taken.open("rb")
        except FileNotFoundError:
            return Orders()
        with file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            found = [_ORDER.fullmatch(line) for line in _lines_of(file)]
        wanted = [(match[1], int(match[2])) for match in found if match]
        return Orders(
            frozenset(number for what, number in wanted if what == b"retry"),
            frozenset(number for what, number in wanted if what == b"drop"),
        )

    def end_orders(self) -> None:
        """Remove the orders that were taken: they are carried out.

        Raises:
            OSError: if the disk refuses; they are carried out again, which changes nothing.
        """
        self._taken.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _number_of(self, line: bytes) -> int | None:
        try:
            number, letter = read_dead(line)
        except RecordError as error:
            _LOG.warning("a dead letter cannot be read: %s", error)
            return None
        self._letters[number] = letter
        return number


def read_all(folder: Path) -> Sequence[Kept]:
    """Read the dead letters of a folder without touching it.

    Raises:
        OSError: if they cannot be read; a folder without any has none.
    """
    letters = []
    try:
        lines = (folder / DEAD).read_bytes().splitlines(keepends=True)
    except FileNotFoundError:
        return []
    for line in lines:
        try:
            letters.append(Kept(*read_dead(line)))
        except RecordError:
            continue  # The broker logs it
    return letters


def order(folder: Path, what: str, numbers: Iterable[int]) -> None:
    """Ask the broker to retry or drop dead letters.

    Raises:
        OSError: if the folder cannot be written to.
    """
    lines = "".join(f"{what} {number}\n" for number in numbers)
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW
    path, is_written = folder / ORDERS, False
    while not is_written:
        with os.fdopen(os.open(path, flags, 0o600), "wb") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            if _is_same(path, file.fileno()):  # Else the broker has taken it meanwhile
                file.write(lines.encode("ascii"))
                is_written = True


def _is_same(path: Path, descriptor: int) -> bool:
    """Whether a path still names an open file."""
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def _lines_of(file: BinaryIO) -> Iterator[bytes]:
    """Give the lines that are short enough for an order; the file may have any size."""
    is_begin = True
    while piece := file.readline(_LINE_BYTES):
        is_end = piece.endswith(b"\n") or len(piece) < _LINE_BYTES
        if is_begin and is_end:
            yield piece
        is_begin = piece.endswith(b"\n")
