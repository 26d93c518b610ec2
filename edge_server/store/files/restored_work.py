"""What a restored database must not do by itself: fly.

Since the backup a mission that waited in it may have been flown, cancelled or aborted, and nobody
can say which. All that had not begun are held until somebody dispatches them. Those that the broker
had accepted get a new number, as after any withdrawal, so that no broker takes them for known.
"""

import sqlite3
import time
from contextlib import closing
from pathlib import Path
from typing import Final

_NOT_BEGUN: Final = """
    SELECT id, state FROM work
    WHERE kind = 'mission' AND status_id = 1
        AND (state = 'accepted' OR (state = 'queued' AND held = 0))
    ORDER BY id
"""


def hold_missions(database: Path) -> int:
    """Hold the missions of a database that have not begun; returns how many there are.

    The schema may be an older one. None is found in one that cannot hold missions.

    Raises:
        sqlite3.Error: if the database cannot be written; then nothing has changed.
    """
    with closing(sqlite3.connect(database)) as connection, connection:
        if "held" not in _columns(connection, "work"):
            return 0
        found = connection.execute(_NOT_BEGUN).fetchall()
        for number, state in found:
            connection.execute("UPDATE work SET held = 1 WHERE id = ?", (number,))
            if state == "accepted":
                _queue_anew(connection, number)
        return len(found)


def _queue_anew(connection: sqlite3.Connection, number: int) -> None:
    (newest,) = connection.execute("SELECT seq FROM sqlite_sequence WHERE name = 'work'").fetchone()
    if _columns(connection, "withdrawn"):
        connection.execute(
            "INSERT INTO withdrawn SELECT work.id, plan.plan_id, vehicle_id, mission_id, ? "
            'FROM work JOIN plan ON work."plan" = plan.id WHERE work.id = ?',
            (time.time(), number),
        )
    connection.execute(
        "UPDATE work SET id = ?, state = 'queued' WHERE id = ?", (newest + 1, number)
    )
    connection.execute("UPDATE command SET work = ? WHERE work = ?", (newest + 1, number))
    if "accepted_at" in _columns(connection, "work"):
        connection.execute("UPDATE work SET accepted_at = NULL WHERE id = ?", (newest + 1,))
    connection.execute("UPDATE sqlite_sequence SET seq = ? WHERE name = 'work'", (newest + 1,))


def _columns(connection: sqlite3.Connection, table: str) -> set[str]:
    """Names of a table's columns; none if there is no such table."""
    return {row[1] for row in connection.execute(f"PRAGMA table_info({table})")}
