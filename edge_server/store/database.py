"""Engine and transactions.

SQLite: one writer at a time, taken with BEGIN IMMEDIATE; readers are never held up (WAL). A
commit is on the disk before it returns (synchronous=FULL).
"""

import json
import sqlite3
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

from sqlalchemy import Connection, CursorResult, Engine, create_engine, event
from sqlalchemy.exc import OperationalError

BUSY_TIMEOUT_MS: Final = 5000
PRAGMAS: Final = (
    "PRAGMA journal_mode=WAL",
    "PRAGMA synchronous=FULL",
    f"PRAGMA busy_timeout={BUSY_TIMEOUT_MS}",
    "PRAGMA foreign_keys=ON",
    "PRAGMA wal_autocheckpoint=1000",
    "PRAGMA journal_size_limit=67108864",
)
ENGINE_OPTIONS: Final[dict[str, Any]] = {
    "pool_size": 8,
    "max_overflow": 64,
    "pool_timeout": 10,
    "connect_args": {"check_same_thread": False},
}
_IMMEDIATE: Final = "edge_immediate"


def sqlite_url(path: object) -> str:
    """Give the URL of a SQLite file."""
    return f"sqlite:///{path}"


def open_engine(url: str) -> Engine:
    """Make an engine of our own, outside Flask."""
    return prepare_engine(create_engine(url, **ENGINE_OPTIONS))


def prepare_engine(engine: Engine) -> Engine:
    """Give every connection our pragmas and our own BEGIN."""
    event.listen(engine, "connect", _on_connect)
    event.listen(engine, "begin", _on_begin)
    return engine


def _on_connect(connection: sqlite3.Connection, _record: object) -> None:
    connection.isolation_level = None  # The driver's own BEGIN comes too late; see _on_begin
    for pragma in PRAGMAS:
        connection.execute(pragma).close()


def _on_begin(connection: Connection) -> None:
    immediate = connection.get_execution_options().get(_IMMEDIATE)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if immediate else "BEGIN")


class Database:
    """Transactions on one engine; safe to share between threads."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._writer = engine.execution_options(**{_IMMEDIATE: True})
        # SQLite's own wait for the writer sleeps in steps of up to 100 ms; ours does not.
        self._one_writer = threading.Lock()

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """Open a transaction that may change things; all of it happens, or nothing."""
        with self._one_writer, self._writer.begin() as connection:
            yield connection

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """Open a transaction that sees one state of the database."""
        with self._engine.connect() as connection:
            yield connection

    def close(self) -> None:
        """Close all connections."""
        self._engine.dispose()


def new_id(result: CursorResult[Any]) -> int:
    """Give the id of the row that an INSERT has made."""
    (identifier,) = result.inserted_primary_key or (None,)
    if not isinstance(identifier, int):
        raise TypeError("the table has no integer key")
    return identifier


def is_full(error: OperationalError) -> bool:
    """Whether the disk, or what the database may use of it, is full."""
    name = getattr(error.orig, "sqlite_errorname", "")
    return name == "SQLITE_FULL" or name.startswith("SQLITE_IOERR_WRITE")


def is_busy(error: OperationalError) -> bool:
    """Whether another writer held the database for too long."""
    return getattr(error.orig, "sqlite_errorname", "").startswith(("SQLITE_BUSY", "SQLITE_LOCKED"))


def to_json(value: Any) -> str:
    """Write compact JSON; NaN and infinity raise ValueError."""
    return _encode(value)


_encode: Final[Callable[[Any], str]] = json.JSONEncoder(
    ensure_ascii=False, allow_nan=False, separators=(",", ":")
).encode
