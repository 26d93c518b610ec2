"""Tables of the archive, and how its file is opened.

The archive is a SQLite file beside the edge server's database, whichever engine that has: its size
is its budget, and its loss affects no promise. A commit survives the end of the process, but not
always a loss of power (synchronous=NORMAL), so that a report costs no second flush of the disk.

A file that is broken, or made by another version, is set aside; one such file is kept.
"""

import logging
import sqlite3
from collections.abc import Sequence
from pathlib import Path
from typing import Final

LOG = logging.getLogger(__name__)
VERSION: Final = 1
"""Of the tables; in the file as user_version."""
APPLICATION_ID: Final = 0x464C4154
BUSY_TIMEOUT_S: Final = 0.1
"""A report waits so long at most for another program that has locked the file."""
PAGE_BYTES: Final = 4096
_LOG_PAGES: Final = 500
_UNUSABLE: Final = frozenset({sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB})
_TABLES: Final = """
CREATE TABLE flight (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    vehicle_id INTEGER NOT NULL,
    mission_id INTEGER,
    plan_id TEXT,
    mission_status_id INTEGER,
    message TEXT,
    started_at REAL NOT NULL,
    ended_at REAL,
    last_at REAL NOT NULL,
    received_at REAL NOT NULL,
    distance_m REAL NOT NULL DEFAULT 0,
    latitude REAL,
    longitude REAL,
    point_at REAL,
    dropped INTEGER NOT NULL DEFAULT 0
);
CREATE INDEX flight_of_vehicle ON flight (vehicle_id, started_at);
CREATE INDEX flight_of_plan ON flight (plan_id, mission_id, vehicle_id);
CREATE TABLE command (
    flight INTEGER NOT NULL,
    command_id INTEGER NOT NULL,
    status_id INTEGER NOT NULL,
    message TEXT,
    started_at REAL,
    ended_at REAL,
    PRIMARY KEY (flight, command_id)
) WITHOUT ROWID;
CREATE TABLE point (
    flight INTEGER NOT NULL,
    at_ms INTEGER NOT NULL,
    sequence_number INTEGER NOT NULL,
    latitude REAL NOT NULL,
    longitude REAL NOT NULL,
    altitude REAL NOT NULL,
    speed REAL NOT NULL,
    heading REAL NOT NULL,
    battery REAL,
    PRIMARY KEY (flight, at_ms, sequence_number)
) WITHOUT ROWID;
CREATE TABLE result (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    flight INTEGER NOT NULL,
    kind TEXT NOT NULL,
    message_id TEXT NOT NULL UNIQUE,
    recorded_at REAL NOT NULL,
    document TEXT NOT NULL
);
CREATE INDEX result_of_flight ON result (flight, kind, id);
CREATE TABLE picture (
    id INTEGER PRIMARY KEY,
    flight INTEGER NOT NULL,
    number INTEGER NOT NULL,
    message_id TEXT NOT NULL UNIQUE,
    recorded_at REAL NOT NULL,
    format TEXT NOT NULL,
    name TEXT NOT NULL,
    size_bytes INTEGER NOT NULL,
    latitude REAL,
    longitude REAL,
    altitude REAL,
    data BLOB NOT NULL,
    UNIQUE (flight, number)
);
CREATE TABLE alarm (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    flight INTEGER,
    vehicle_id INTEGER NOT NULL,
    mission_id INTEGER,
    message_id TEXT NOT NULL UNIQUE,
    recorded_at REAL NOT NULL,
    received_at REAL NOT NULL,
    alarm_type_id INTEGER NOT NULL,
    alarm_code_id INTEGER NOT NULL,
    param_array TEXT NOT NULL,
    message TEXT,
    acknowledged_at REAL,
    acknowledged_by TEXT
);
CREATE INDEX alarm_of_flight ON alarm (flight);
CREATE TABLE vehicle (vehicle_id INTEGER PRIMARY KEY, armed INTEGER NOT NULL);
"""
_ADDED: Final = """
DROP TABLE IF EXISTS map;
CREATE TABLE IF NOT EXISTS flight_map (
    flight INTEGER NOT NULL,
    band TEXT NOT NULL,
    made_at REAL NOT NULL,
    about TEXT NOT NULL,
    data BLOB NOT NULL,
    PRIMARY KEY (flight, band)
);
CREATE TABLE IF NOT EXISTS disarming (vehicle_id INTEGER PRIMARY KEY, at REAL NOT NULL);
CREATE TABLE IF NOT EXISTS log (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    vehicle_id INTEGER NOT NULL,
    name TEXT NOT NULL,
    format TEXT NOT NULL,
    started_at REAL NOT NULL,
    ended_at REAL NOT NULL,
    listed_s INTEGER NOT NULL,
    size_bytes INTEGER NOT NULL,
    received_bytes INTEGER NOT NULL DEFAULT 0,
    is_complete INTEGER NOT NULL DEFAULT 0,
    changed_at REAL NOT NULL,
    dropped INTEGER NOT NULL DEFAULT 0,
    UNIQUE (vehicle_id, name)
);
CREATE TABLE IF NOT EXISTS lost (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    vehicle_id INTEGER NOT NULL,
    since REAL NOT NULL,
    until REAL NOT NULL,
    reports INTEGER NOT NULL
);
CREATE INDEX IF NOT EXISTS log_of_vehicle ON log (vehicle_id, started_at);
CREATE INDEX IF NOT EXISTS alarm_received ON alarm (received_at);
CREATE INDEX IF NOT EXISTS alarm_acknowledged ON alarm (acknowledged_at);
CREATE TABLE IF NOT EXISTS log_part (
    id INTEGER PRIMARY KEY,
    log INTEGER NOT NULL,
    offset INTEGER NOT NULL,
    data BLOB NOT NULL,
    UNIQUE (log, offset)
);
"""
"""What an archive of this version may lack: it is made when the archive is opened."""


class _OtherVersionError(Exception):
    """The file was made by another version, or by another program."""


def is_unusable(error: Exception) -> bool:
    """Whether an error shows that the file is broken, or no database."""
    code = getattr(error, "sqlite_errorcode", None)
    return isinstance(error, sqlite3.DatabaseError) and (code or 0) & 0xFF in _UNUSABLE


def is_full(error: Exception) -> bool:
    """Whether an error shows that the disk or the budget is used up."""
    code = getattr(error, "sqlite_errorcode", None)
    return (code or 0) & 0xFF == sqlite3.SQLITE_FULL


def lacks_table(error: Exception) -> bool:
    """Whether an error shows that nothing was written since a version without some table."""
    return isinstance(error, sqlite3.OperationalError) and "no such table" in str(error)


def open_for_writing(path: Path, budget_bytes: int) -> sqlite3.Connection:
    """Open the file, made if it is missing; SQLite itself refuses to exceed the budget.

    Raises:
        sqlite3.Error, OSError: if it cannot be opened.
    """
    try:
        return _open(path, budget_bytes)
    except (_OtherVersionError, sqlite3.DatabaseError) as error:
        if not (isinstance(error, _OtherVersionError) or is_unusable(error)):
            raise
        set_aside(path, str(error))
        return _open(path, budget_bytes)


def _open(path: Path, budget_bytes: int) -> sqlite3.Connection:
    connection = sqlite3.connect(
        path, timeout=BUSY_TIMEOUT_S, isolation_level=None, check_same_thread=False
    )
    try:
        _prepare(connection)
        pages = max(budget_bytes // PAGE_BYTES, 1)
        connection.execute(f"PRAGMA max_page_count={pages}").close()
    except BaseException:
        connection.close()
        raise
    return connection


def _prepare(connection: sqlite3.Connection) -> None:
    version = _number(connection, "user_version")
    application = _number(connection, "application_id")
    (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    if not tables:
        connection.execute(f"PRAGMA page_size={PAGE_BYTES}").close()
        connection.execute("PRAGMA auto_vacuum=INCREMENTAL").close()
    elif (version, application) != (VERSION, APPLICATION_ID):
        raise _OtherVersionError(f"its tables have version {version}, not {VERSION}")
    for setting in (
        "journal_mode=WAL",
        "synchronous=NORMAL",
        "secure_delete=OFF",
        f"wal_autocheckpoint={_LOG_PAGES}",
        f"journal_size_limit={_LOG_PAGES * PAGE_BYTES}",
    ):
        connection.execute(f"PRAGMA {setting}").close()
    if not tables:
        # Pragmas inside the transaction: a file is either empty or complete
        connection.executescript(
            f"BEGIN IMMEDIATE; {_TABLES} {_ADDED} PRAGMA application_id={APPLICATION_ID};"
            f" PRAGMA user_version={VERSION}; COMMIT;"
        )
    else:
        connection.executescript(_ADDED)


def _number(connection: sqlite3.Connection, pragma: str) -> int:
    (found,) = connection.execute(f"PRAGMA {pragma}").fetchone()
    return int(found)


def open_for_reading(path: Path) -> sqlite3.Connection | None:
    """Open the file to read; None while it is not made completely. Raises sqlite3.Error."""
    if not path.exists():
        return None
    connection = sqlite3.connect(
        f"{path.absolute().as_uri()}?mode=ro",
        uri=True,
        timeout=BUSY_TIMEOUT_S,
        isolation_level=None,
        check_same_thread=False,
    )
    try:
        is_complete = _number(connection, "user_version") > 0
    except BaseException:
        connection.close()
        raise
    if not is_complete:  # The writer has just made the file
        connection.close()
        return None
    connection.row_factory = sqlite3.Row
    return connection


def last_ids(connection: sqlite3.Connection) -> list[tuple[str, int]]:
    """Return the largest id that each table has given, also of rows that are deleted."""
    return list(connection.execute("SELECT name, seq FROM sqlite_sequence"))


def keep_ids_above(connection: sqlite3.Connection, ids: Sequence[tuple[str, int]]) -> None:
    """Let a new file give larger ids than the one before: links to that lead nowhere else."""
    for name, last in ids:
        connection.execute("DELETE FROM sqlite_sequence WHERE name = ?", (name,)).close()
        connection.execute("INSERT INTO sqlite_sequence VALUES (?, ?)", (name, last)).close()


def files_of(path: Path) -> tuple[Path, ...]:
    """Return the file of the archive and those that SQLite keeps beside it."""
    return (path, path.with_name(f"{path.name}-wal"), path.with_name(f"{path.name}-shm"))


def set_aside_path(path: Path) -> Path:
    """Return where an unusable archive is kept."""
    return path.with_name(f"{path.name}.set-aside")


def set_aside(path: Path, reason: str) -> None:
    """Rename an unusable archive; it replaces the one that was set aside before."""
    kept = set_aside_path(path)
    LOG.error("the flight archive %s cannot be used and is set aside as %s: %s", path, kept, reason)
    for file in files_of(path)[1:]:
        file.unlink(missing_ok=True)
    path.replace(kept)
