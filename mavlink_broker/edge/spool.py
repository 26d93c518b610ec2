"""The spool: posts that wait for the edge server, on disk, with a limit on their size.

Reports and pictures have a file each, so that pictures can be evicted at once. `Report` means every
post but a picture here: reports, alarms, result sets and acknowledgements exist in the broker
alone, while a picture is still on its vehicle. A post for which there is no space waits in memory.

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
    PendingPost,
    RecordError,
    decode,
    encode_answered,
    encode_post,
)

MIB: Final = 1 << 20
REPORTS_FILE: Final = "spool.words"
PICTURES_FILE: Final = "spool.pictures"
LOCK_FILE: Final = "broker.lock"
PICTURES_SHARE: Final = 2
"""Pictures may take one part in so many."""
DEAD_LETTERS_SHARE: Final = 4
"""Dead letters have a limit of their own: one part in so many."""

_LOG = logging.getLogger(__name__)


class SpoolError(Exception):
    """The spool cannot be used."""


class SpoolBusyError(SpoolError):
    """Another broker uses it."""


class Spool:
    """Posts that wait, on disk; for one thread at a time."""

    def __init__(self, folder: Path, *, max_bytes: int) -> None:
        """Lock the folder, and read the posts of an earlier run.

        Raises:
            SpoolBusyError: if another broker has locked it.
            SpoolError: if it cannot be used.
        """
        self.folder = folder
        self._max_bytes = max_bytes
        self._reports = LineFile(folder / REPORTS_FILE)
        self._pictures = LineFile(folder / PICTURES_FILE)
        self._evicted: set[int] = set()
        self.damaged = 0  # Lines that could not be read
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = _lock(folder / LOCK_FILE)
            self.dead_letters = DeadLetters(folder, max_bytes // DEAD_LETTERS_SHARE)
            inherited = {**self._recover(self._reports), **self._recover(self._pictures)}
        except OSError as error:
            raise SpoolError(f"{folder}: {error.strerror or error}") from error
        self._number = max(max(inherited, default=0), self.dead_letters.highest)
        self._inherited = [
            inherited[number] for number in sorted(inherited) if number not in self.dead_letters
        ]

    @property
    def writes(self) -> int:
        """Number of changes to its files."""
        return self._reports.writes + self._pictures.writes

    def __contains__(self, number: int) -> bool:
        return number in self._reports or number in self._pictures

    def take_inherited(self) -> Sequence[Post]:
        """Give the posts of an earlier run, in order; once."""
        inherited, self._inherited = self._inherited, []
        return inherited

    def next_number(self) -> int:
        """Give a number that no post has had."""
        self._number += 1
        return self._number

    def store_reports(self, posts: Iterable[Post]) -> None:
        """Write posts other than pictures, each under its number, those of one lane in order.

        Raises:
            OSError: if the disk refuses; the first of them may be stored nevertheless.
        """
        lines = _lines(posts)
        try:
            self._add_reports(lines)
        except OSError:
            if len(lines) == 1:
                raise
            for number, line in lines.items():
                self._add_reports({number: line})

    def store_pictures(self, posts: Iterable[Post]) -> None:
        """Write pictures, within their share of the space.

        Raises:
            OSError: if there is no space; the first of them may be stored nevertheless.
        """
        limit = min(self._max_bytes // PICTURES_SHARE, self._max_bytes - self._reports.size_bytes)
        for number, line in _lines(posts).items():
            if self._pictures.live_bytes + len(line) > limit:
                raise OSError(errno.ENOSPC, "their share is used up")
            if self._pictures.size_bytes + len(line) > limit:
                self._pictures.compact()
            self._pictures.add({number: line})

    def take_evicted(self) -> frozenset[int]:
        """Give the numbers of the pictures that were evicted since the last call."""
        evicted, self._evicted = frozenset(self._evicted), set()
        return evicted

    def release(self, numbers: frozenset[int]) -> None:
        """Remove posts that have their final answer.

        Raises:
            OSError: if the disk refuses; the next run may send some of them again.
        """
        note = encode_answered(numbers)
        try:
            self._reports.release(numbers, note)
        finally:
            self._pictures.release(numbers, note)

    def close(self) -> None:
        """Close the files and unlock the folder."""
        self._reports.close()
        self._pictures.close()
        self.dead_letters.close()
        os.close(self._lock)

    def _add_reports(self, lines: Mapping[int, bytes]) -> None:
        """Add all or none."""
        size = sum(map(len, lines.values()))
        if self._reports.live_bytes + size > self._max_bytes:
            raise OSError(errno.ENOSPC, f"{self._max_bytes // MIB} MiB are used up")
        if self._reports.size_bytes + size > self._max_bytes:
            self._reports.compact()
        if self._reports.size_bytes + self._pictures.size_bytes + size > self._max_bytes:
            self._evict_pictures()
        try:
            self._reports.add(lines)
        except OSError:
            if not self._pictures.size_bytes:
                raise
            self._evict_pictures()  # The disk may be full because of them
            self._reports.add(lines)

    def _evict_pictures(self) -> None:
        self._evicted |= self._pictures.numbers
        self._pictures.clear()

    def _recover(self, file: LineFile) -> dict[int, Post]:
        """Read the posts of a file that have no answer, and discard the others."""
        posts: dict[int, Post] = {}

        def number_of(line: bytes) -> int | None:
            try:
                record = decode(line)
            except RecordError as error:
                self.damaged += 1
                _LOG.debug("%s: a line cannot be read: %s", self.folder, error)
                return None
            if isinstance(record, PendingPost):
                posts[record.number] = record.post
                return record.number
            for number in record.numbers:
                posts.pop(number, None)
            return None

        file.read(number_of)
        file.discard(file.numbers - posts.keys())
        return posts


def _lines(posts: Iterable[Post]) -> dict[int, bytes]:
    return {
        post.spool_number: encode_post(post.spool_number, post)
        for post in posts
        if post.spool_number
    }


def _lock(path: Path) -> int:
    """Lock the folder; the lock ends with the process.

    Raises:
        SpoolBusyError: if another process has locked it.
        OSError: if it cannot be locked.
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
