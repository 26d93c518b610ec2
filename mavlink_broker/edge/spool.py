"""The spool: posts that wait for the edge server, in the broker's database, with a limit.

`Report` means every post but a picture here: reports, alarms, result sets and acknowledgements
exist in the broker alone, while a picture is still on its vehicle. Where there is no space for
reports all pictures are evicted. A post for which there is no space waits in memory.
"""

import errno
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Final

from mavlink_broker.database import Database
from mavlink_broker.edge.dead_letters import DeadLetters
from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.spool_record import RecordError, decode_post, encode_post

MIB: Final = 1 << 20
ROWS_PER_DELETION: Final = 50
"""In one transaction, which so fits into the reserve of the database."""
PICTURES_SHARE: Final = 2
"""Pictures may take one part in so many."""
DEAD_LETTERS_SHARE: Final = 4
"""Dead letters have a limit of their own: one part in so many."""


_ALL: Final = "SELECT number, is_picture, CAST(data AS BLOB) FROM posts ORDER BY number"


class Spool:
    """Posts that wait, on disk; for one thread at a time."""

    def __init__(self, database: Database, *, max_bytes: int) -> None:
        """Read the posts of an earlier run; invalid ones are set aside and counted.

        Raises:
            OSError: if they cannot be read.
        """
        self.database = database
        self.dead_letters = DeadLetters(database, max_bytes // DEAD_LETTERS_SHARE)
        self.damaged = 0  # Posts that could not be read
        self._max_bytes = max_bytes
        self._reports: dict[int, int] = {}  # [bytes] By number
        self._pictures: dict[int, int] = {}
        self._evicted: set[int] = set()
        self._released: set[int] = set()  # Not removed from the disk yet
        self._inherited = self._recover()
        with suppress(OSError):
            self.release(frozenset())
        self._number = max(self.dead_letters.highest, *self._reports, *self._pictures, 0)

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
        encoded = _encoded(posts)
        try:
            self._add_reports(encoded)
        except OSError:
            if len(encoded) == 1:
                raise
            for number, data in encoded.items():
                self._add_reports({number: data})

    def store_pictures(self, posts: Iterable[Post]) -> None:
        """Write pictures, within their share of the space.

        Raises:
            OSError: if there is no space; the first of them may be stored nevertheless.
        """
        reports_bytes = sum(self._reports.values())
        limit = min(self._max_bytes // PICTURES_SHARE, self._max_bytes - reports_bytes)
        for number, data in _encoded(posts).items():
            if sum(self._pictures.values()) + len(data) > limit:
                raise OSError(errno.ENOSPC, "their share is used up")
            self._insert({number: data}, self._pictures)

    def take_evicted(self) -> frozenset[int]:
        """Give the numbers of the pictures that were evicted since the last call."""
        evicted, self._evicted = frozenset(self._evicted), set()
        return evicted

    def release(self, numbers: frozenset[int]) -> None:
        """Remove posts that have their final answer.

        Raises:
            OSError: if the disk refuses; they are removed with the next ones.
        """
        for number in numbers:
            if self._reports.pop(number, None) or self._pictures.pop(number, None):
                self._released.add(number)
        if self._released:
            self._delete(self._released)
            self._released.clear()

    def _add_reports(self, encoded: Mapping[int, bytes]) -> None:
        """Add all or none."""
        size = sum(self._reports.values()) + sum(map(len, encoded.values()))
        if size > self._max_bytes:
            raise OSError(errno.ENOSPC, f"{self._max_bytes // MIB} MiB are used up")
        if size + sum(self._pictures.values()) > self._max_bytes:
            self._evict_pictures()
        try:
            self._insert(encoded, self._reports)
        except OSError:
            if not self._pictures:
                raise
            self._evict_pictures()  # The disk may be full because of them
            self._insert(encoded, self._reports)

    def _evict_pictures(self) -> None:
        self._delete(self._pictures)
        self._evicted |= self._pictures.keys()
        self._pictures.clear()

    def _insert(self, encoded: Mapping[int, bytes], kind: dict[int, int]) -> None:
        is_picture = kind is self._pictures
        with self.database.change(sum(map(len, encoded.values()))) as rows:
            rows.executemany(
                "INSERT OR REPLACE INTO posts VALUES (?, ?, ?)",
                [(number, is_picture, data) for number, data in encoded.items()],
            )
        kind.update({number: len(data) for number, data in encoded.items()})

    def _delete(self, numbers: Collection[int]) -> None:
        for some in _in_parts(numbers):
            with self.database.change() as rows:
                rows.executemany("DELETE FROM posts WHERE number = ?", [(one,) for one in some])

    def _recover(self) -> list[Post]:
        """Read the posts of an earlier run; those that became dead letters are released."""
        posts = []
        for number, is_picture, data in self.database.read(_ALL):
            try:
                post = decode_post(number, data)
            except RecordError as error:
                self.damaged += 1
                self.database.set_aside("posts", number, str(error))
                continue
            if number in self.dead_letters:
                self._released.add(number)
                continue
            (self._pictures if is_picture else self._reports)[number] = len(data)
            posts.append(post)
        return posts


def _in_parts(numbers: Collection[int]) -> Iterator[Sequence[int]]:
    for start in range(0, len(numbers), ROWS_PER_DELETION):
        yield sorted(numbers)[start : start + ROWS_PER_DELETION]


def _encoded(posts: Iterable[Post]) -> dict[int, bytes]:
    return {
        post.spool_number: encode_post(post.spool_number, post)
        for post in posts
        if post.spool_number
    }
