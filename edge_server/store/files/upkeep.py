"""Returns free pages of a SQLite file to its disk, also when the disk is full.

Deleted rows leave free pages in the file, which only this file can use; the write-ahead log beside
it grows until it is written into the file. Returning pages takes a little room itself, so it is
done in small steps, each written into the file before the next one.
"""

import logging
import sqlite3
from enum import StrEnum
from typing import Final, NamedTuple

from sqlalchemy.exc import OperationalError

from edge_server.store.connection.database import Database
from edge_server.store.connection.failures import is_busy

LOG = logging.getLogger(__name__)
STEP_PAGES: Final = 64


class Pages(NamedTuple):
    """A file's pages: all, those that are free, and the size of each [bytes]."""

    total: int
    free: int
    size_bytes: int

    @property
    def free_bytes(self) -> int:
        """Size of the free pages."""
        return self.free * self.size_bytes


def look(database: Database) -> Pages:
    """Return how much of the file is in use.

    Raises:
        DBAPIError: if the file cannot be read now.
    """
    names = ("page_count", "freelist_count", "page_size")
    return database.tend(
        lambda file: Pages(*(int(file.execute(f"PRAGMA {name}").fetchone()[0]) for name in names))
    )


class CheckpointResult(StrEnum):
    """Result of an attempt to empty the write-ahead log."""

    DONE = "done"
    BUSY = "busy"  # Another connection reads or writes; retry later
    FULL = "full"  # There is no room for the growth of the file


def checkpoint(database: Database) -> CheckpointResult:
    """Write the write-ahead log into the file and empty it.

    Raises:
        DBAPIError: if the file is broken.
    """
    try:
        busy, *_ = database.tend(
            lambda file: file.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
        )
    except OperationalError as error:
        LOG.debug("the write-ahead log cannot be emptied now: %s", error.orig)
        return CheckpointResult.BUSY if is_busy(error) else CheckpointResult.FULL
    return CheckpointResult.BUSY if busy else CheckpointResult.DONE


def release_pages(database: Database, steps: int) -> bool:
    """Return free pages to the disk in at most `steps` steps; returns whether the file shrank.

    A file that an older version made cannot return pages; its free pages are used again.
    """
    before = look(database)
    try:
        for _ in range(steps):
            if not look(database).free:
                break
            database.tend(_take_a_step)
            checkpoint(database)
    except OperationalError as error:
        LOG.debug("no more pages can be returned now: %s", error.orig)
    return look(database).total < before.total


def _take_a_step(file: sqlite3.Connection) -> None:
    # As a script: the statement returns a page with each result row, and `execute` reads one row
    file.executescript(f"PRAGMA incremental_vacuum({STEP_PAGES});")
