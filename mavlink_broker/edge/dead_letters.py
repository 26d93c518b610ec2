"""Dead letters: posts that the edge server never accepted, kept on disk until a person decides.

A post that is refused for good would be refused again, and one that fails again and again while
others are answered blocks the posts behind it. Either is removed from its lane, stored here with
the reason, and sent again or removed by a person: `python -m mavlink_broker dead-letters`. That
command only reads the file and writes its actions to a second file, which the running broker or
the next one carries out. The broker renames the second file before it reads it, and removes it
when all actions are carried out: actions that are requested meanwhile start a new file, and those
that a killed broker has taken are carried out by the next.
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
from mavlink_broker.edge.spool_record import RecordError, decode_dead_letter, encode_dead_letter

DEAD_LETTERS_FILE: Final = "spool.dead"
ACTIONS_FILE: Final = "spool.dead.orders"
TAKEN_FILE: Final = "spool.dead.orders.taken"
"""Actions that are being carried out."""
_ACTION: Final = re.compile(rb"(retry|drop) ([0-9]{1,16})\n?")
_LINE_BYTES: Final = 64
"""More than the longest action has."""

_LOG = logging.getLogger(__name__)


class StoredLetter(NamedTuple):
    """A dead letter and its number."""

    number: int
    letter: DeadLetter


class Actions(NamedTuple):
    """What a person requests for dead letters, by number."""

    retry: frozenset[int] = frozenset()
    drop: frozenset[int] = frozenset()


class DeadLetters:
    """The dead letters of one broker; the lock of the spool's folder covers them."""

    def __init__(self, folder: Path, max_bytes: int) -> None:
        """Read the file.

        Raises:
            OSError: if it cannot be read.
        """
        self._actions = folder / ACTIONS_FILE
        self._taken = folder / TAKEN_FILE
        self._max_bytes = max_bytes
        self._file = LineFile(folder / DEAD_LETTERS_FILE)
        self._letters: dict[int, DeadLetter] = {}
        self._file.read(self._number_of)

    @property
    def by_vehicle(self) -> dict[int, int]:
        """The number of dead letters of each vehicle."""
        counts: dict[int, int] = {}
        for letter in self._letters.values():
            vehicle_id = letter.post.vehicle_id
            counts[vehicle_id] = counts.get(vehicle_id, 0) + 1
        return counts

    def __contains__(self, number: int) -> bool:
        return number in self._letters

    def add(self, number: int, letter: DeadLetter) -> None:
        """Store one; the oldest are removed where there is no space.

        Raises:
            OSError: if the disk refuses.
        """
        line = encode_dead_letter(number, letter)
        while self._letters and self._file.live_bytes + len(line) > self._max_bytes:
            oldest = min(self._letters)
            _LOG.error("dead letter %d is removed: there is no space", oldest)
            self.remove({oldest})
        if self._file.size_bytes + len(line) > self._max_bytes and self._letters:
            self._file.compact()
        self._file.add({number: line})
        self._letters[number] = letter

    def get(self, number: int) -> Post | None:
        """Give the post of one to be sent again; the letter stays until it is removed."""
        letter = self._letters.get(number)
        if letter is None:
            return None
        return replace(
            letter.post, attempts=0, may_be_duplicate=True, spool_number=None, is_inherited=True
        )

    def remove(self, numbers: Collection[int]) -> None:
        """Remove some.

        Raises:
            OSError: if the disk refuses; the next run finds them again.
        """
        for number in numbers:
            self._letters.pop(number, None)
        self._file.discard(numbers)
        if self._letters:
            self._file.compact()
        else:
            self._file.clear()

    @property
    def highest(self) -> int:
        """The highest number of a dead letter; 0 without any."""
        return max(self._letters, default=0)

    def take_actions(self) -> Actions:
        """Read the actions that a person has requested; `complete_actions` removes them.

        Raises:
            OSError: if the file cannot be read, or is still being written.
        """
        try:
            if not self._taken.exists():
                self._actions.rename(self._taken)
            file = self._taken.open("rb")
        except FileNotFoundError:
            return Actions()
        with file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            matches = [_ACTION.fullmatch(line) for line in _lines_of(file)]
        requested = [(match[1], int(match[2])) for match in matches if match]
        return Actions(
            frozenset(number for action, number in requested if action == b"retry"),
            frozenset(number for action, number in requested if action == b"drop"),
        )

    def complete_actions(self) -> None:
        """Remove the actions that were taken: they are carried out.

        Raises:
            OSError: if the disk refuses; they are carried out again, which changes nothing.
        """
        self._taken.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _number_of(self, line: bytes) -> int | None:
        try:
            number, letter = decode_dead_letter(line)
        except RecordError as error:
            _LOG.warning("a dead letter cannot be read: %s", error)
            return None
        self._letters[number] = letter
        return number


def read_dead_letters(folder: Path) -> Sequence[StoredLetter]:
    """Read the dead letters of a folder without changing it; none if there is no file.

    Raises:
        OSError: if they cannot be read.
    """
    letters = []
    try:
        lines = (folder / DEAD_LETTERS_FILE).read_bytes().splitlines(keepends=True)
    except FileNotFoundError:
        return []
    for line in lines:
        try:
            letters.append(StoredLetter(*decode_dead_letter(line)))
        except RecordError:
            continue  # The broker logs it
    return letters


def request_action(folder: Path, action: str, numbers: Iterable[int]) -> None:
    """Have the broker `retry` or `drop` dead letters.

    Raises:
        OSError: if the folder cannot be written to.
    """
    lines = "".join(f"{action} {number}\n" for number in numbers)
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW
    path, is_written = folder / ACTIONS_FILE, False
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
    """Give the lines that are short enough for an action; the file may have any size."""
    is_start = True
    while piece := file.readline(_LINE_BYTES):
        is_end = piece.endswith(b"\n") or len(piece) < _LINE_BYTES
        if is_start and is_end:
            yield piece
        is_start = piece.endswith(b"\n")
