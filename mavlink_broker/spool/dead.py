"""Dead letters: posts that the edge server never takes, kept on disk until somebody decides.

A post that fails again and again while others are answered holds up everything behind it. It is
taken out of its line, kept here with the reason, and sent again or removed by a person:
`python -m mavlink_broker dead-letters`. That command only reads the file; what it asks for goes
into a file beside it, which the broker carries out, the running one or the next.
"""

import logging
import os
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

from mavlink_broker.send_queue import DeadLetter, Post
from mavlink_broker.spool.file import LineFile
from mavlink_broker.spool.record import RecordError, line_of_dead, read_dead

DEAD: Final = "spool.dead"
ORDERS: Final = "spool.dead.orders"
MOST_ORDERS_BYTES: Final = 1 << 20
_ORDER: Final = re.compile(r"(retry|drop) ([0-9]{1,16})")

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
        """Read and remove what a person has asked for; nothing, if nothing.

        Raises:
            OSError: if there is something that cannot be read.
        """
        try:
            with self._orders.open("rb") as file:
                text = file.read(MOST_ORDERS_BYTES).decode("ascii", "replace")
        except FileNotFoundError:
            return Orders()
        self._orders.unlink()
        found = [_ORDER.fullmatch(line) for line in text.splitlines()]
        wanted = [(match[1], int(match[2])) for match in found if match]
        return Orders(
            frozenset(number for what, number in wanted if what == "retry"),
            frozenset(number for what, number in wanted if what == "drop"),
        )

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
    descriptor = os.open(folder / ORDERS, flags, 0o600)
    try:
        os.write(descriptor, lines.encode("ascii"))
    finally:
        os.close(descriptor)
