"""Which streams a relay sends: all of them where it is the only one, its share where it is not.

`Streams` is what the relay asks; `AllStreams` serves a SQLite file, whose one relay holds the lock
of the state folder; `outbox/sharing.py` serves a PostgreSQL database with any number of relays.

ReplacedError  the database file is another one than the one that we read
"""

from collections.abc import Set as AbstractSet
from pathlib import Path
from typing import NamedTuple, Protocol

from edge_server.outbox import queue
from edge_server.outbox.queue import Stream
from edge_server.store.database import Database


class ReplacedError(Exception):
    """The database file is another one than the one that we read."""


class Situation(NamedTuple):
    """How the relay stands; time is in monotonic seconds."""

    now: float
    is_open: bool  # Whether the way to the cloud is free, as far as it knows
    busy: AbstractSet[Stream]  # Something of them is read, under way or not written yet
    flying: AbstractSet[Stream]  # Something of them is under way or not written yet


class Found(NamedTuple):
    """What a look has found."""

    news: AbstractSet[Stream]  # Ours, with rows that were not there before
    gone: AbstractSet[Stream]  # Not ours, or no longer


class Streams(Protocol):
    """Which streams to send."""

    def look(self, situation: Situation) -> Found:
        """Find what has come, and take or give streams where there are other relays."""

    def close(self) -> None:
        """Send none any more."""


class AllStreams:
    """Every stream of a database that no other relay reads."""

    def __init__(self, database: Database, path: Path) -> None:
        self._database = database
        self._path = path
        self._inode = path.stat().st_ino
        self._newest_row = 0

    def look(self, _situation: Situation) -> Found:
        """Find streams with new rows.

        Raises:
            ReplacedError: if the server has set a broken database aside and made a new one.
        """
        self._check_file()
        with self._database.read() as connection:
            news, self._newest_row = queue.streams_after(connection, self._newest_row)
        return Found(news, frozenset())

    def close(self) -> None:
        """Nothing is held."""

    def _check_file(self) -> None:
        try:
            inode = self._path.stat().st_ino
        except FileNotFoundError:
            inode = 0
        if inode != self._inode:
            raise ReplacedError(f"{self._path} has been replaced")
