"""Returns free pages of a SQLite file to its disk, also when the disk is full.

Deleted rows leave free pages in the file, which only this file can use; the write-ahead log beside
it grows until it is written into the file. Returning pages takes a little room itself, so it is
done in small steps, each written into the file before the next one.

Some free pages and the log's usual size are never returned: what is small, as an order to stop, is
written into them on a disk that another program keeps full.
"""

import logging
import os
import shutil
import sqlite3
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import Final, NamedTuple

from sqlalchemy.exc import OperationalError

from edge_server.store.connection.database import Database
from edge_server.store.connection.engines import log_bytes
from edge_server.store.connection.failures import is_busy

LOG = logging.getLogger(__name__)
STEP_PAGES: Final = 64
KEPT_PAGES: Final = 128
"""Free pages that stay in the file."""


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
    """Write the write-ahead log into the file, and take the disk's room for the log's usual size.

    What the log has beyond that is returned to the disk by the next transaction.

    Raises:
        DBAPIError: if the file is broken.
    """
    try:
        busy = database.tend(_restart_log)
    except OperationalError as error:
        LOG.debug("the write-ahead log cannot be emptied now: %s", error.orig)
        return CheckpointResult.BUSY if is_busy(error) else CheckpointResult.FULL
    return CheckpointResult.BUSY if busy else CheckpointResult.DONE


def _restart_log(file: sqlite3.Connection) -> bool:
    """Let the log be written over from its beginning; whether another connection prevents that."""
    busy, *_ = file.execute("PRAGMA wal_checkpoint(RESTART)").fetchone()
    _hold_log(file)
    return bool(busy)


def _hold_log(file: sqlite3.Connection) -> None:
    """Take the disk's room for the log's usual size: SQLite reads no zeros behind its frames."""
    (_, _, path) = file.execute("PRAGMA database_list").fetchone()
    log = Path(f"{path}-wal")
    with suppress(OSError):  # Another program has taken the room
        descriptor = os.open(log, os.O_RDWR | os.O_CLOEXEC)
        try:
            kept_bytes = log_bytes(shutil.disk_usage(log.parent).total)
            os.posix_fallocate(descriptor, 0, kept_bytes)
        finally:
            os.close(descriptor)


def hold_room(database: Database) -> bool:
    """Take the log's usual size and some free pages of the disk; returns whether they are there.

    Raises:
        DBAPIError: if the file is broken.
    """
    try:
        database.tend(_hold_log)
        if look(database).free < KEPT_PAGES // 2:
            database.tend(_add_free_pages)
            checkpoint(database)  # Into the file, so that the log is free again
    except OperationalError as error:
        LOG.debug("no room can be held now: %s", error.orig)
        return is_busy(error)  # It is tried again in the next cycle
    return True


def _add_free_pages(file: sqlite3.Connection) -> None:
    """Fill pages and free them: the file keeps them until `release_pages`."""
    size_bytes = KEPT_PAGES * int(file.execute("PRAGMA page_size").fetchone()[0])
    try:
        file.execute("BEGIN IMMEDIATE")
        file.execute("CREATE TABLE reserve (content BLOB)")
        file.execute("INSERT INTO reserve VALUES (zeroblob(?))", (size_bytes,))
        file.execute("DROP TABLE reserve")
        file.execute("COMMIT")
    finally:
        if file.in_transaction:
            file.execute("ROLLBACK")


def release_pages(database: Database, steps: int) -> bool:
    """Return free pages to the disk in at most `steps` steps; returns whether the file shrank.

    A file that an older version made cannot return pages; its free pages are used again.
    """
    before = look(database)
    try:
        for _ in range(steps):
            if look(database).free <= KEPT_PAGES:
                break
            database.tend(_take_a_step)
            checkpoint(database)
    except OperationalError as error:
        LOG.debug("no more pages can be returned now: %s", error.orig)
    return look(database).total < before.total


def _take_a_step(file: sqlite3.Connection) -> None:
    # As a script: the statement returns a page with each result row, and `execute` reads one row
    # Another thread may have used some since: 0 would return all of them
    free = int(file.execute("PRAGMA freelist_count").fetchone()[0])
    file.executescript(f"PRAGMA incremental_vacuum({max(1, min(STEP_PAGES, free - KEPT_PAGES))});")
