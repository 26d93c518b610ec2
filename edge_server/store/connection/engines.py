"""An engine per kind of database, configured for durable commits.

SQLite: one writer at a time, by BEGIN IMMEDIATE; readers never wait (WAL). A commit is on the disk
before it returns (synchronous=FULL).

PostgreSQL: writers run concurrently at READ COMMITTED and take the locks of
`store/connection/locks.py`; readers see one state (REPEATABLE READ). A commit is on the disk before
it returns (synchronous_commit=on). Every wait has a timeout, and a writer that stalls is
disconnected.
"""

import shutil
import sqlite3
from pathlib import Path
from typing import Any, Final

from sqlalchemy import Connection, Engine, create_engine, event

from edge_server.store.connection import locks

BUSY_TIMEOUT_MS: Final = 5000
PRAGMAS: Final = (
    "PRAGMA journal_mode=WAL",
    "PRAGMA synchronous=FULL",
    "PRAGMA foreign_keys=ON",
    "PRAGMA cache_size=-512",  # KiB; another connection's write empties it, the system has the file
    "PRAGMA secure_delete=FAST",  # Overwriting a deleted picture would need its size once more
)
SESSION: Final = {
    "synchronous_commit": "on",
    "lock_timeout": f"{BUSY_TIMEOUT_MS}ms",
    "statement_timeout": "30s",
    "idle_in_transaction_session_timeout": "15s",
    "tcp_keepalives_idle": "5",  # A machine that lost its power is noticed in 11 s
    "tcp_keepalives_interval": "2",
    "tcp_keepalives_count": "3",
}
"""Settings of every session on PostgreSQL."""
_SQLITE_OPTIONS: Final[dict[str, Any]] = {
    "pool_size": 8,
    "pool_use_lifo": True,  # Each has a cache of pages: most requests use the same few
    "max_overflow": 64,
    "pool_timeout": 10,
    "connect_args": {"check_same_thread": False},
}
_POSTGRESQL_OPTIONS: Final[dict[str, Any]] = {
    "pool_size": 8,
    "max_overflow": 8,  # A hundred connections are PostgreSQL's usual limit, for all together
    "pool_timeout": 10,
    "connect_args": {
        "application_name": "edge_server",
        "client_encoding": "utf8",
        "connect_timeout": 3,
        "keepalives_idle": 5,
        "keepalives_interval": 2,
        "keepalives_count": 3,
        "tcp_user_timeout": 10_000,
        "options": " ".join(f"-c {name}={value}" for name, value in SESSION.items()),
    },
}
_PAGE_BYTES: Final = 4096
_LOG_HEADER_BYTES: Final = 32
_TRANSACTION_PAGES: Final = 64
"""Of a large one that holds no picture."""
_FRAME_HEADER_BYTES: Final = 24
_LOG_PART_OF_DISK: Final = 64
_LARGE_DISK_BYTES: Final = 2**40
_IMMEDIATE: Final = "edge_immediate"
WRITING: Final[dict[str, Any]] = {_IMMEDIATE: True}
"""Execution options of a transaction that may change something."""
READING: Final[dict[str, Any]] = {
    "isolation_level": "REPEATABLE READ",
    "postgresql_readonly": True,
}
"""Execution options of a transaction on PostgreSQL that sees one state."""


def sqlite_url(path: object) -> str:
    """Return the URL of a SQLite file."""
    return f"sqlite:///{path}"


def open_engine(url: str) -> Engine:
    """Make an engine that configures every connection for its kind of database."""
    options = _SQLITE_OPTIONS if url.startswith("sqlite:") else _POSTGRESQL_OPTIONS
    engine = create_engine(url, **options)
    if engine.dialect.name == "sqlite":
        event.listen(engine, "connect", _on_sqlite_connect)
        event.listen(engine, "begin", _on_sqlite_begin)
    else:
        event.listen(engine, "connect", _on_postgresql_connect)
        event.listen(engine, "begin", locks.reset)
    return engine


def _on_postgresql_connect(connection: Any, _record: object) -> None:
    """Write a NUL, which PostgreSQL's text cannot hold, as the replacement character."""
    from edge_server.store.connection.postgresql import TextDumper  # noqa: PLC0415  # loads psycopg

    connection.adapters.register_dumper(str, TextDumper)


def _on_sqlite_connect(connection: sqlite3.Connection, _record: object) -> None:
    connection.isolation_level = None  # The driver's own BEGIN is too late; see below
    connection.execute(f"PRAGMA busy_timeout={BUSY_TIMEOUT_MS}").close()
    if _is_empty(connection):
        # Has no effect on a file with tables, but would write to it
        connection.execute("PRAGMA auto_vacuum=INCREMENTAL").close()
    for pragma in PRAGMAS:
        connection.execute(pragma).close()
    disk_bytes = _disk_bytes(connection)
    connection.execute(f"PRAGMA wal_autocheckpoint={log_pages(disk_bytes)}").close()
    connection.execute(f"PRAGMA journal_size_limit={log_bytes(disk_bytes)}").close()


def _is_empty(connection: sqlite3.Connection) -> bool:
    (pages,) = connection.execute("PRAGMA page_count").fetchone()
    return not pages


def _disk_bytes(connection: sqlite3.Connection) -> int:
    """Return the size of the disk that holds the database; a large one for one in memory."""
    (_, _, path) = connection.execute("PRAGMA database_list").fetchone()
    return shutil.disk_usage(Path(path).parent).total if path else _LARGE_DISK_BYTES


def log_pages(disk_bytes: int) -> int:
    """Return after how many pages the write-ahead log is written into the database.

    The log takes room beside the pages that it changes, so on a small disk it is kept small.
    """
    return min(max(disk_bytes // _LOG_PART_OF_DISK // _PAGE_BYTES, 64), 1000)


def log_bytes(disk_bytes: int) -> int:
    """Return the size that the write-ahead log keeps [bytes].

    It is written into the database behind the transaction that exceeds `log_pages`, so it has room
    for one more.
    """
    frames = log_pages(disk_bytes) + _TRANSACTION_PAGES
    return frames * (_PAGE_BYTES + _FRAME_HEADER_BYTES) + _LOG_HEADER_BYTES


def _on_sqlite_begin(connection: Connection) -> None:
    immediate = connection.get_execution_options().get(_IMMEDIATE)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if immediate else "BEGIN")
