"""How a SQLite file gives room back to its disk, also when the disk is full.

Deleted rows leave free pages in the file, which only this file can use; the log of changes beside
it grows until it is written into the file. To give pages back takes a little room itself, so it
goes in small steps, each written into the file before the next one.
"""

import logging
import sqlite3
from enum import StrEnum
from typing import Final, NamedTuple

from sqlalchemy.exc import OperationalError

from edge_server.store.database import Database
from edge_server.store.failures import is_busy

LOG = logging.getLogger(__name__)
STEP_PAGES: Final = 64


class Pages(NamedTuple):
    """A file's pages: all, those that are free, and the size of each [bytes]."""

    total: int
    free: int
    size_bytes: int

    @property
    def free_bytes(self) -> int:
        """How much of the file holds nothing."""
        return self.free * self.size_bytes


def look(database: Database) -> Pages:
    """See how much of the file is in use.

    Raises:
        DBAPIError: if the file cannot be read now.
    """
    names = ("page_count", "freelist_count", "page_size")
    return database.tend(
        lambda file: Pages(*(int(file.execute(f"PRAGMA {name}").fetchone()[0]) for name in names))
    )


class Outcome(StrEnum):
    """What became of an attempt to empty the log of changes."""

    DONE = "done"
    BUSY = "busy"  # Somebody reads or writes; later
    FULL = "full"  # There is no room for what the file has to grow by


def checkpoint(database: Database) -> Outcome:
    """Write the log of changes into the file and empty it.

    Raises:
        DBAPIError: if the file is broken.
    """
    try:
        busy, *_ = database.tend(
            lambda file: file.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
        )
    except OperationalError as error:
        LOG.debug("the log of changes cannot be emptied now: %s", error.orig)
        return Outcome.BUSY if is_busy(error) else Outcome.FULL
    return Outcome.BUSY if busy else Outcome.DONE


def give_back(database: Database, steps: int) -> bool:
    """Give free pages back to the disk, so many steps; says whether any went.

    A file that an older version made cannot give pages back; its free pages are used again.
    """
    before = look(database)
    try:
        for _ in range(steps):
            if not look(database).free:
                break
            database.tend(_take_a_step)
            checkpoint(database)
    except OperationalError as error:
        LOG.debug("no more pages can be given back now: %s", error.orig)
    return look(database).total < before.total


def _take_a_step(file: sqlite3.Connection) -> None:
    # As a script: the statement gives a page back with each row, of which `execute` takes one
    file.executescript(f"PRAGMA incremental_vacuum({STEP_PAGES});")
