"""Dead letters: posts that the edge server never accepted, kept on disk until a person decides.

A post that is refused for good would be refused again, and one that fails again and again while
others are answered blocks the posts behind it. Either is removed from its lane, stored here with
the reason, and sent again or removed by a person: `python -m mavlink_broker dead-letters`. That
command only adds requests, which the running broker or the next one carries out and then removes:
those that a killed broker has taken are carried out by the next.
"""

import logging
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

from mavlink_broker.database import Database, add_requests, read_rows
from mavlink_broker.edge.outbox import DeadLetter, Post
from mavlink_broker.edge.spool_record import RecordError, decode_dead_letter, encode_dead_letter

_ALL: Final = "SELECT number, CAST(data AS BLOB) FROM dead_letters ORDER BY number"

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
    """The dead letters of one broker."""

    def __init__(self, database: Database, max_bytes: int) -> None:
        """Read those of an earlier run; invalid ones are set aside.

        Raises:
            OSError: if they cannot be read.
        """
        self._database = database
        self._max_bytes = max_bytes
        self._letters: dict[int, DeadLetter] = {}
        self._sizes: dict[int, int] = {}  # [bytes] By number
        self._taken = 0  # The newest request that was taken
        for number, data in database.read(_ALL):
            try:
                self._letters[number] = decode_dead_letter(number, data)
                self._sizes[number] = len(data)
            except RecordError as error:
                database.set_aside("dead_letters", number, str(error))

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
        data = encode_dead_letter(number, letter)
        while self._letters and sum(self._sizes.values()) + len(data) > self._max_bytes:
            oldest = min(self._letters)
            _LOG.error("dead letter %d is removed: there is no space", oldest)
            self.remove({oldest})
        with self._database.change(len(data)) as rows:
            rows.execute("INSERT OR REPLACE INTO dead_letters VALUES (?, ?)", (number, data))
        self._letters[number], self._sizes[number] = letter, len(data)

    def get(self, number: int) -> Post | None:
        """Give the post of one to be sent again; the letter stays until it is removed."""
        letter = self._letters.get(number)
        if letter is None:
            return None
        return replace(
            letter.post,
            attempts=0,
            may_be_duplicate=True,
            spool_number=None,
            is_inherited=True,
            is_retried=True,
        )

    def remove(self, numbers: Collection[int]) -> None:
        """Remove some.

        Raises:
            OSError: if the disk refuses; the next run finds them again.
        """
        for number in numbers:
            self._letters.pop(number, None)
            self._sizes.pop(number, None)
        with self._database.change() as rows:
            delete = "DELETE FROM dead_letters WHERE number = ?"
            rows.executemany(delete, [(number,) for number in numbers])

    @property
    def highest(self) -> int:
        """The highest number of a dead letter; 0 without any."""
        return max(self._letters, default=0)

    def take_actions(self) -> Actions:
        """Read the actions that a person has requested; `complete_actions` removes them.

        Raises:
            OSError: if they cannot be read.
        """
        requested = self._database.read("SELECT id, action, CAST(number AS INTEGER) FROM requests")
        self._taken = max((identifier for identifier, _, _ in requested), default=0)
        return Actions(
            frozenset(number for _, action, number in requested if action == "retry"),
            frozenset(number for _, action, number in requested if action == "drop"),
        )

    def complete_actions(self) -> None:
        """Remove the actions that were taken: they are carried out.

        Raises:
            OSError: if the disk refuses; they are carried out again, which changes nothing.
        """
        if self._taken:
            with self._database.change() as rows:
                rows.execute("DELETE FROM requests WHERE id <= ?", (self._taken,))
            self._taken = 0


def read_dead_letters(folder: Path) -> Sequence[StoredLetter]:
    """Read the dead letters of a folder without changing it; none if there is no database.

    Raises:
        OSError: if they cannot be read.
    """
    letters = []
    for number, data in read_rows(folder, _ALL):
        try:
            letters.append(StoredLetter(number, decode_dead_letter(number, data)))
        except RecordError:
            continue  # The broker logs it
    return letters


def request_action(folder: Path, action: str, numbers: Iterable[int]) -> None:
    """Have the broker `retry` or `drop` dead letters.

    Raises:
        OSError: if the database cannot be written to.
    """
    add_requests(folder, action, list(numbers))
