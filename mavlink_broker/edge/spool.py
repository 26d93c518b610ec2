"""The spool as a whole: who may use it, what goes into which file, and what has room.

Words and pictures have a file each, so that pictures can give way at once: reports, alarms,
result sets and acknowledgements exist here alone, a picture is still on its vehicle. What has no
room waits in memory alone, as everything did before.

SpoolError       the spool cannot be used
  +- SpoolBusyError  another broker uses it
"""

import errno
import fcntl
import logging
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

from mavlink_broker.edge.dead_letters import DeadLetters
from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.spool_file import LineFile
from mavlink_broker.edge.spool_record import (
    RecordError,
    Waiting,
    line_of,
    line_of_answered,
    read,
)

MIB: Final = 1 << 20
WORDS: Final = "spool.words"
PICTURES: Final = "spool.pictures"
LOCK: Final = "broker.lock"
PICTURES_SHARE: Final = 2
"""They may take one part in so many."""
DEAD_SHARE: Final = 4
"""Dead letters have room of their own: as much as one part in so many."""

_LOG = logging.getLogger(__name__)


class SpoolError(Exception):
    """The spool cannot be used."""


class SpoolBusyError(SpoolError):
    """Another broker uses it."""


class Spool:
    """Posts that wait, on disk; one thread at a time."""

    def __init__(self, folder: Path, *, most_bytes: int) -> None:
        """Take the folder, and read what an earlier run has left.

        Raises:
            SpoolBusyError: if another broker has it.
            SpoolError: if it cannot be used.
        """
        self.folder = folder
        self._most_bytes = most_bytes
        self._words = LineFile(folder / WORDS)
        self._pictures = LineFile(folder / PICTURES)
        self._given_up: set[int] = set()
        self.damaged = 0  # Lines that could not be read
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = _lock(folder / LOCK)
            self.dead = DeadLetters(folder, most_bytes // DEAD_SHARE)
            left = {**self._recover(self._words), **self._recover(self._pictures)}
        except OSError as error:
            raise SpoolError(f"{folder}: {error.strerror or error}") from error
        self._number = max(max(left, default=0), self.dead.highest)
        left = {number: post for number, post in left.items() if number not in self.dead}
        self._left = [left[number] for number in sorted(left)]

    @property
    def writes(self) -> int:
        """How often the disk was asked to change something."""
        return self._words.writes + self._pictures.writes

    def __contains__(self, number: int) -> bool:
        return number in self._words or number in self._pictures

    def take_left(self) -> Sequence[Post]:
        """Give what an earlier run has left, in order; once."""
        left, self._left = self._left, []
        return left

    def next_number(self) -> int:
        """Give a number that no post has had."""
        self._number += 1
        return self._number

    def keep_words(self, posts: Iterable[Post]) -> None:
        """Put posts onto the disk, each under its number, those of one lane in order.

        Raises:
            OSError: if the disk refuses; the first of them may be there nevertheless.
        """
        lines = _lines(posts)
        try:
            self._add_words(lines)
        except OSError:
            if len(lines) == 1:
                raise
            for number, line in lines.items():
                self._add_words({number: line})

    def keep_pictures(self, posts: Iterable[Post]) -> None:
        """Do the same with pictures, within their share.

        Raises:
            OSError: if there is no room; the first of them may be there nevertheless.
        """
        room = min(self._most_bytes // PICTURES_SHARE, self._most_bytes - self._words.size_bytes)
        for number, line in _lines(posts).items():
            if self._pictures.live_bytes + len(line) > room:
                raise OSError(errno.ENOSPC, "their share is used up")
            if self._pictures.size_bytes + len(line) > room:
                self._pictures.write_anew()
            self._pictures.add({number: line})

    def take_given_up(self) -> frozenset[int]:
        """Give the pictures that have lost their place since this was asked."""
        given_up, self._given_up = frozenset(self._given_up), set()
        return given_up

    def settle(self, numbers: frozenset[int]) -> None:
        """Let go of posts that have their answer.

        Raises:
            OSError: if the disk refuses; the next run may tell some of them again.
        """
        word = line_of_answered(numbers)
        try:
            self._words.let_go(numbers, word)
        finally:
            self._pictures.let_go(numbers, word)

    def close(self) -> None:
        """Leave the folder to others."""
        self._words.close()
        self._pictures.close()
        self.dead.close()
        os.close(self._lock)

    def _add_words(self, lines: Mapping[int, bytes]) -> None:
        """Add all or none."""
        size = sum(map(len, lines.values()))
        if self._words.live_bytes + size > self._most_bytes:
            raise OSError(errno.ENOSPC, f"{self._most_bytes // MIB} MiB are used up")
        if self._words.size_bytes + size > self._most_bytes:
            self._words.write_anew()
        if self._words.size_bytes + self._pictures.size_bytes + size > self._most_bytes:
            self._give_pictures_up()
        try:
            self._words.add(lines)
        except OSError:
            if not self._pictures.size_bytes:
                raise
            self._give_pictures_up()  # Their room may be what is lacking
            self._words.add(lines)

    def _give_pictures_up(self) -> None:
        self._given_up |= self._pictures.numbers
        self._pictures.clear()

    def _recover(self, file: LineFile) -> dict[int, Post]:
        """Read what waits in a file, and let go of the rest."""
        found: dict[int, Post] = {}

        def number_of(line: bytes) -> int | None:
            try:
                record = read(line)
            except RecordError as error:
                self.damaged += 1
                _LOG.debug("%s: a line cannot be read: %s", self.folder, error)
                return None
            if isinstance(record, Waiting):
                found[record.number] = record.post
                return record.number
            for number in record.numbers:
                found.pop(number, None)
            return None

        file.read(number_of)
        file.forget(file.numbers - found.keys())
        return found


def _lines(posts: Iterable[Post]) -> dict[int, bytes]:
    return {post.kept_as: line_of(post.kept_as, post) for post in posts if post.kept_as}


def _lock(path: Path) -> int:
    """Take the folder's lock; it goes with the process.

    Raises:
        SpoolBusyError: if another process has it.
        OSError: if there can be none.
    """
    flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    descriptor = os.open(path, flags, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise SpoolBusyError(f"another broker uses {path.parent}") from None
    except OSError:
        os.close(descriptor)
        raise
    return descriptor
