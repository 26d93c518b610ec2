"""Keeps the archive within its days and its MiB: the oldest whole flight is dropped first.

A flight is first marked as dropped, so that nobody sees a part of it, and then deleted in small
transactions, so that no report waits for long. Flights that have not ended are kept.
"""

import sqlite3
from typing import Final

from edge_server.archive import logs

_PICTURES: Final = 16  # Per transaction, at most 1 MiB each
_ROWS: Final = 2000
_FREED_PAGES: Final = 400
"""So few fit into the log of changes as it is: a full disk has no room for a longer one."""
_OLDEST: Final = "SELECT id FROM flight WHERE ended_at IS NOT NULL AND dropped = 0"


def used_bytes(connection: sqlite3.Connection) -> int:
    """Return the bytes of the file that hold something."""
    (pages,) = connection.execute("PRAGMA page_count").fetchone()
    (free,) = connection.execute("PRAGMA freelist_count").fetchone()
    (size,) = connection.execute("PRAGMA page_size").fetchone()
    return int((pages - free) * size)


def running_bytes(connection: sqlite3.Connection) -> int:
    """Return the bytes of the pictures and maps of flights that have not ended, which are kept."""
    (size,) = connection.execute(
        "SELECT coalesce(sum(length(data)), 0) FROM"
        " (SELECT flight, data FROM picture UNION ALL SELECT flight, data FROM flight_map)"
        " JOIN flight ON flight.id = flight WHERE ended_at IS NULL AND dropped = 0"
    ).fetchone()
    return int(size)


def drop_part(connection: sqlite3.Connection) -> bool:
    """Delete a part of what is marked as dropped; returns whether there was any."""
    if logs.drop_part(connection):
        return True
    row = connection.execute("SELECT id FROM flight WHERE dropped = 1 LIMIT 1").fetchone()
    if row is None:
        return False
    if logs.mark_orphans(connection):
        return True
    flight: int = row[0]
    deleted = connection.execute(
        "DELETE FROM picture WHERE id IN (SELECT id FROM picture WHERE flight = ? LIMIT ?)",
        (flight, _PICTURES),
    ).rowcount
    if deleted:
        return True
    last = connection.execute(
        "SELECT at_ms FROM point WHERE flight = ? ORDER BY at_ms LIMIT 1 OFFSET ?", (flight, _ROWS)
    ).fetchone()
    if last is not None:
        connection.execute("DELETE FROM point WHERE flight = ? AND at_ms < ?", (flight, last[0]))
        deleted = connection.execute("SELECT changes()").fetchone()[0]
        if deleted:
            return True
    for table in ("point", "result", "command", "alarm", "flight_map"):
        connection.execute(f"DELETE FROM {table} WHERE flight = ?", (flight,))  # noqa: S608  # fixed names
    connection.execute("DELETE FROM flight WHERE id = ?", (flight,))
    return True


def mark_oldest(connection: sqlite3.Connection) -> bool:
    """Mark the oldest flight to be dropped, or delete old alarms; false if nothing is left."""
    marked = connection.execute(
        f"UPDATE flight SET dropped = 1 WHERE id = ({_OLDEST} ORDER BY started_at, id LIMIT 1)"  # noqa: S608  # fixed text
    ).rowcount
    if marked:
        return True
    return bool(
        connection.execute(
            "DELETE FROM alarm WHERE id IN"
            " (SELECT id FROM alarm WHERE flight IS NULL ORDER BY id LIMIT ?)",
            (_ROWS,),
        ).rowcount
    )


def mark_aged(connection: sqlite3.Connection, before: float) -> None:
    """Mark the flights that ended before a time, and delete alarms from before it."""
    connection.execute(
        "UPDATE flight SET dropped = 1 WHERE ended_at < ? AND received_at < ? AND dropped = 0",
        (before, before),
    )
    connection.execute("DELETE FROM alarm WHERE flight IS NULL AND received_at < ?", (before,))


def return_pages(connection: sqlite3.Connection) -> bool:
    """Return some free pages to the disk; returns whether there are more."""
    (free,) = connection.execute("PRAGMA freelist_count").fetchone()
    if free:
        # As a script: each step frees one page, and `execute` makes the first step only
        connection.executescript(f"PRAGMA incremental_vacuum({_FREED_PAGES});").close()
    return bool(free > _FREED_PAGES)


def checkpoint(connection: sqlite3.Connection) -> None:
    """Write the log of changes into the file and shorten it."""
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
