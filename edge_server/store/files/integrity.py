"""Whether a SQLite file is intact: a short check before the first request, a full one afterwards.

Checking a million records may take longer than a start should. The check is cut short after a
moment, and repeated in full while the server runs. A process that finds a fault, then or while it
reads, leaves a note beside the file. The server ends on it, and the next start sets the file aside.

TakesTooLongError  the check was cut short; its result is unknown
"""

import logging
import os
import sqlite3
import threading
from contextlib import closing
from pathlib import Path
from typing import Final

from sqlalchemy.exc import DBAPIError

from edge_server.store.files.found_by_shape import JSON_COLUMNS, has_readable_json

LOG = logging.getLogger(__name__)
PATIENCE_S: Final = 0.5
_BROKEN: Final = frozenset({sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT})
_PRIMARY: Final = 0xFF
"""The lower byte of an extended result code (sqlite.org/rescode.html)."""


class TakesTooLongError(Exception):
    """The check was cut short; its result is unknown."""


def fault_of(path: Path, patience_s: float = threading.TIMEOUT_MAX) -> str | None:
    """Return what is wrong with a file, None if it is intact.

    Raises:
        TakesTooLongError: if it takes longer than `patience_s`.
    """
    address = f"{path.absolute().as_uri()}?mode=rw"  # Does not make a missing file
    with closing(
        sqlite3.connect(address, uri=True, timeout=5.0, check_same_thread=False)
    ) as connection:
        watch = threading.Timer(patience_s, connection.interrupt)
        watch.daemon = True
        watch.start()
        try:
            (found,) = connection.execute("PRAGMA quick_check(1)").fetchone()
            if found == "ok":
                found = _unreadable(connection) or found
        except sqlite3.DatabaseError as error:
            if error.sqlite_errorcode == sqlite3.SQLITE_INTERRUPT:
                raise TakesTooLongError(path) from None
            if not _is_broken(error):
                raise
            return str(error)
        finally:
            watch.cancel()
            watch.join()
    return None if found == "ok" else str(found)


def _unreadable(connection: sqlite3.Connection) -> str | None:
    """Return the first row of people and brokers whose JSON cannot be read.

    SQLite does not detect a flipped bit inside a row. One unreadable row of work keeps all other
    work from every broker.
    """
    connection.text_factory = bytes  # json.loads checks the encoding too
    for table, columns in JSON_COLUMNS.items():
        names = ", ".join(columns)
        try:
            for rowid, *values in connection.execute(f"SELECT rowid, {names} FROM {table}"):  # noqa: S608  # our own names
                row = dict(zip(columns, values, strict=True))
                if not has_readable_json(table, row):
                    return f"row {rowid} of {table} cannot be read"
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode != sqlite3.SQLITE_ERROR:
                raise
            LOG.debug("a database of an older version: %s", error)
    return None


def is_broken(error: DBAPIError) -> bool:
    """Whether an error means that the file is broken."""
    return isinstance(error.orig, sqlite3.Error) and _is_broken(error.orig)


def _is_broken(error: sqlite3.Error) -> bool:
    return getattr(error, "sqlite_errorcode", 0) & _PRIMARY in _BROKEN


def note_fault(path: Path, fault: str) -> None:
    """Leave a note that a file is broken, on the disk before this returns."""
    note = _note(path)
    part = note.with_name(f"{note.name}.{os.getpid()}.{threading.get_ident()}")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.write(fault or "broken")
            file.flush()
            os.fsync(file.fileno())
        part.replace(note)
    except OSError as error:
        LOG.critical("the database is broken (%s), and no note can be left: %s", fault, error)


def noted_fault(path: Path) -> str | None:
    """Return the fault that was noted since a file was last prepared."""
    try:
        return _note(path).read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        return None


def clear_fault(path: Path) -> None:
    """Delete the note: the broken file has been set aside."""
    _note(path).unlink(missing_ok=True)


def _note(path: Path) -> Path:
    return path.with_name(path.name + ".broken")
