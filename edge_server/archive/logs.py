"""The logs of flights that vehicles and the broker write, received in parts.

A log belongs to every flight of its vehicle that it overlaps: two missions without a landing in
between have one log, a mission with a landing in between has several. It is deleted with the last
of its flights, before that when logs use more than their share of the archive, or when its
transfer has not gone on for a day.

All functions run in the transaction of their caller. Times are seconds since 1970.
"""

import sqlite3
from typing import Final, NamedTuple

SHARE: Final = 0.5
"""Of the archive's budget: tracks and pictures of older flights matter more than their logs."""
ABANDONED_S: Final = 86_400.0
"""An incomplete log is deleted so long after its last part."""
_PARTS: Final = 4  # Deleted per transaction, at most 1 MiB each
_OVERLAPS: Final = (
    "log.vehicle_id = flight.vehicle_id AND log.started_at <= coalesce(flight.ended_at, 9e15)"
    " AND log.ended_at >= flight.started_at"
)
Row = sqlite3.Row


class LogUpload(NamedTuple):
    """What a broker says of a log before it sends it.

    `started_at` and `ended_at` are when its vehicle was armed and disarmed, `listed_s` is the time
    that the vehicle itself lists the log with [s since 1970, by its clock].
    """

    vehicle_id: int
    name: str
    format: str
    started_at: float
    ended_at: float
    listed_s: int
    size_bytes: int


class LogGapError(Exception):
    """A part begins elsewhere than where the received ones end, or the log is complete."""


def begin(connection: sqlite3.Connection, upload: LogUpload, at: float) -> bool:
    """Begin a log; returns whether it is new, rather than begun before."""
    return bool(
        connection.execute(
            "INSERT OR IGNORE INTO log (vehicle_id, name, format, started_at, ended_at, listed_s,"
            " size_bytes, changed_at) VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
            (*upload, at),
        ).rowcount
    )


def flies(connection: sqlite3.Connection, upload: LogUpload) -> bool:
    """Whether the archive has a flight that the log belongs to."""
    return (
        connection.execute(
            "SELECT 1 FROM flight WHERE vehicle_id = ? AND dropped = 0 AND started_at <= ?"
            " AND coalesce(ended_at, 9e15) >= ? LIMIT 1",
            (upload.vehicle_id, upload.ended_at, upload.started_at),
        ).fetchone()
        is not None
    )


def append(
    connection: sqlite3.Connection,
    row_id: int,
    offset: int,
    data: bytes,
    at: float,
    *,
    is_last: bool,
) -> None:
    """Add a part where the received ones end.

    Raises:
        LogGapError: if it begins elsewhere, or the log was completed or dropped meanwhile.
    """
    changed = connection.execute(
        "UPDATE log SET received_bytes = received_bytes + ?, changed_at = ?, is_complete = ?"
        " WHERE id = ? AND received_bytes = ? AND is_complete = 0 AND dropped = 0",
        (len(data), at, is_last, row_id, offset),
    ).rowcount
    if not changed:
        raise LogGapError
    if data:
        connection.execute(
            "INSERT INTO log_part (log, offset, data) VALUES (?, ?, ?)", (row_id, offset, data)
        )


def mark(connection: sqlite3.Connection, row_id: int) -> None:
    """Mark a log to be deleted."""
    connection.execute("UPDATE log SET dropped = 1 WHERE id = ?", (row_id,))


def mark_orphans(connection: sqlite3.Connection) -> bool:
    """Mark the logs of which no flight is left; returns whether there were any."""
    flown = f"SELECT 1 FROM flight WHERE flight.dropped = 0 AND {_OVERLAPS}"  # noqa: S608  # fixed text
    return bool(
        connection.execute(
            f"UPDATE log SET dropped = 1 WHERE dropped = 0 AND NOT EXISTS ({flown})"  # noqa: S608  # fixed text
        ).rowcount
    )


def mark_excess(connection: sqlite3.Connection, budget_bytes: int, now: float) -> bool:
    """Mark an abandoned log, or the oldest one while logs use more than their share.

    Returns whether one was marked.
    """
    (used,) = connection.execute(
        "SELECT coalesce(sum(received_bytes), 0) FROM log WHERE dropped = 0"
    ).fetchone()
    return bool(
        connection.execute(
            "UPDATE log SET dropped = 1 WHERE id = (SELECT id FROM log WHERE dropped = 0"
            " AND (? OR (is_complete = 0 AND changed_at < ?)) ORDER BY started_at, id LIMIT 1)",
            (used > SHARE * budget_bytes, now - ABANDONED_S),
        ).rowcount
    )


def drop_part(connection: sqlite3.Connection) -> bool:
    """Delete a part of what is marked; returns whether there was any."""
    row = connection.execute("SELECT id FROM log WHERE dropped = 1 LIMIT 1").fetchone()
    if row is None:
        return False
    deleted = connection.execute(
        "DELETE FROM log_part WHERE id IN (SELECT id FROM log_part WHERE log = ? LIMIT ?)",
        (row[0], _PARTS),
    ).rowcount
    if not deleted:
        connection.execute("DELETE FROM log WHERE id = ?", (row[0],))
    return True


def find(connection: sqlite3.Connection, vehicle_id: int, name: str) -> Row | None:
    """Find a log by its vehicle and name."""
    found: Row | None = connection.execute(
        "SELECT * FROM log WHERE vehicle_id = ? AND name = ? AND dropped = 0", (vehicle_id, name)
    ).fetchone()
    return found


def incomplete(connection: sqlite3.Connection, vehicle_id: int, limit: int) -> list[Row]:
    """List the logs of a vehicle that are not complete, newest first."""
    return connection.execute(
        "SELECT * FROM log WHERE vehicle_id = ? AND is_complete = 0 AND dropped = 0"
        " ORDER BY id DESC LIMIT ?",
        (vehicle_id, limit),
    ).fetchall()


def of_flight(connection: sqlite3.Connection, flight_id: int, limit: int) -> list[Row]:
    """List the logs of a flight, oldest first."""
    return connection.execute(
        f"SELECT log.* FROM log JOIN flight ON {_OVERLAPS} WHERE flight.id = ? AND log.dropped = 0"  # noqa: S608  # fixed text
        " ORDER BY log.started_at, log.id LIMIT ?",
        (flight_id, limit),
    ).fetchall()


def part_at(connection: sqlite3.Connection, row_id: int, offset: int) -> bytes:
    """Give the bytes of a log from an offset to the end of the part that holds it; empty if none.

    A log that was dropped meanwhile has none.
    """
    row = connection.execute(
        "SELECT substr(data, ? - offset + 1) FROM log_part WHERE log = ? AND offset <= ?"
        " ORDER BY offset DESC LIMIT 1",
        (offset, row_id, offset),
    ).fetchone()
    return b"" if row is None else bytes(row[0])
