"""What the cloud has answered and the database does not know yet; written in groups.

The cloud confirms, then record, outbox row and tombstone change in one transaction. A crash between
the two sends the record again under the same key.
"""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from sqlalchemy.exc import OperationalError

from edge_server.outbox import queue
from edge_server.outbox.answers import Meaning, Verdict
from edge_server.outbox.queue import Delivered, Parcel, Stream
from edge_server.outbox.states import Happening
from edge_server.store import ballast, upkeep
from edge_server.store.database import Database
from edge_server.store.failures import is_full
from edge_server.store.upkeep import Outcome

LOG = logging.getLogger(__name__)

GROUP: Final = 128  # Written in one transaction when so many have gathered, or more
GROUP_WAIT_S: Final = 0.02
RETRY_S: Final = 1.0
MOST: Final = 1024  # While so many cannot be written, nothing more is sent
TOMBSTONES_KEPT_S: Final = 7 * 86400.0
HOUSEKEEPING_S: Final = 600.0


class Entry(NamedTuple):
    """One answer to one record."""

    parcel: Parcel
    happening: Happening
    verdict: Verdict


class Ledger:
    """Times are monotonic seconds, except where they are said to be wall clock."""

    def __init__(self, database: Database, ballast_path: Path | None = None) -> None:
        self._database = database
        self._ballast_path = ballast_path
        self._entries: list[Entry] = []
        self._since = 0.0
        self._not_before = 0.0
        self._clean_at = 0.0
        self._at_once = GROUP

    @property
    def is_full(self) -> bool:
        """Whether the relay has to wait until something can be written."""
        return len(self._entries) >= MOST

    @property
    def streams(self) -> set[Stream]:
        """Streams of which an answer is not written yet."""
        return {entry.parcel.stream for entry in self._entries}

    def note(self, entry: Entry, now: float) -> None:
        """Remember an answer until it is written."""
        if not self._entries:
            self._since = now
        self._entries.append(entry)

    def due_at(self) -> float | None:
        """When to write at the latest; None when there is nothing."""
        return max(self._since + GROUP_WAIT_S, self._not_before) if self._entries else None

    def is_due(self, now: float, *, idle: bool) -> bool:
        """Whether to write now; while nothing is under way there is nothing to wait for."""
        if now < self._not_before:
            return False
        if now >= self._clean_at:
            return True
        gathered = len(self._entries) >= GROUP or now - self._since >= GROUP_WAIT_S
        return bool(self._entries) and (gathered or idle)

    def write(self, now: float, wall_clock: float) -> bool:
        """Write all, in groups; what cannot be written now is kept for later.

        A group is smaller after a disk was full: to delete takes room too, and a small group needs
        little. Returns whether a record had been changed while it was under way.
        """
        changed = False
        while self._entries or now >= self._clean_at:
            group = self._entries[: self._at_once]
            try:
                changed |= self._write(group, now, wall_clock)
            except OperationalError as error:
                LOG.warning("cannot write what the cloud has confirmed: %s", error.orig)
                gave_way = is_full(error) and self.give_way(len(group))
                self._not_before = now + (0.0 if gave_way else RETRY_S)
                break
            del self._entries[: len(group)]
            self._at_once = min(2 * self._at_once, GROUP)
        return changed

    def give_way(self, tried: int = 0) -> bool:
        """Make room on a full disk, or need less of it; says whether there is something to try.

        `tried` is how many entries there was no room for, 0 when it was something else.
        """
        if upkeep.checkpoint(self._database) is Outcome.DONE and tried > 1:
            self._at_once = max(tried // 8, 1)
            return True
        if self._ballast_path is not None and ballast.release(self._ballast_path):
            LOG.warning("the disk is full; the ballast %s is given up", self._ballast_path)
            return True
        self._at_once = max(tried // 8, 1)
        return tried > 1

    def _write(self, entries: Sequence[Entry], now: float, wall_clock: float) -> bool:
        with self._database.write() as connection:
            delivered = [
                Delivered(entry.parcel, entry.verdict.status)
                for entry in entries
                if entry.happening is Happening.CONFIRMED
            ]
            changed = queue.settle(connection, delivered, wall_clock)
            for parcel, happening, verdict in entries:
                attempts = parcel.attempts + 1
                if happening is Happening.REJECTED:
                    queue.bury(connection, parcel, attempts, verdict.reason)
                elif (
                    happening is not Happening.CONFIRMED
                    and verdict.meaning is not Meaning.HELD_BACK
                ):
                    queue.note_failure(connection, parcel, attempts, verdict.reason)
            if now >= self._clean_at:
                queue.forget_tombstones(connection, wall_clock - TOMBSTONES_KEPT_S)
        self._clean_at = max(self._clean_at, now + HOUSEKEEPING_S * (now >= self._clean_at))
        return bool(changed)
