"""Brings a database to the schema that this version of the program needs.

StoreError
  +- NewerDatabaseError  made by a newer version; this one must not touch it
  +- NoSpaceError        the disk has no space for it, also without the reserves
  +- UnreachableError    a database server that may answer later
"""

import fcntl
import logging
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final

from sqlalchemy import Connection, Engine, inspect, make_url, text
from sqlalchemy.exc import DBAPIError

from edge_server.store.connection import locks
from edge_server.store.connection.engines import WRITING, open_engine, sqlite_url
from edge_server.store.connection.failures import is_lost
from edge_server.store.files import high_water, integrity, recovery

LOG = logging.getLogger(__name__)
HEAD: Final = "0016"
_SCRIPTS: Final = Path(__file__).parent / "migrations"
_REPLACEMENT: Final = ".new"
_TEMPORARY: Final = (
    "starting up",
    "shutting down",
    "recovery",
    "too many",
    "not yet",
    "terminating",
)
"""Texts of a server that will accept connections later; a failed connection carries no SQLSTATE."""
_SIDE_FILES: Final = ("-wal", "-shm", "-journal")


class StoreError(Exception):
    """The database cannot be used."""


class NewerDatabaseError(StoreError):
    """The database was made by a newer version."""


class NoSpaceError(StoreError):
    """The disk has no space for the database, also without the reserves."""


class UnreachableError(StoreError):
    """The database server does not answer; later it may."""


def prepare(url: str) -> None:
    """Make the tables if they are missing, bring them up to date; set a broken file aside.

    Programs that start together wait for each other.

    Raises:
        NewerDatabaseError: if a newer version has made it.
        UnreachableError: if it is PostgreSQL and does not answer now.
        StoreError: if it refuses us, or its encoding is not UTF-8.
    """
    path = _file_of(url)
    if path is None:
        _prepare_server(url)
        return
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    with _one_at_a_time(path.parent / "prepare.lock"):
        _prepare_file(path)


def _file_of(url: str) -> Path | None:
    """Return the file of a SQLite database, None for a database server."""
    parsed = make_url(url)
    return Path(parsed.database or "") if parsed.get_backend_name() == "sqlite" else None


def _prepare_server(url: str) -> None:
    engine = open_engine(url)
    try:
        with engine.connect() as connection:
            encoding = connection.execute(text("SHOW server_encoding")).scalar_one()
        if encoding != "UTF8":
            raise StoreError(f"the database's encoding is {encoding}; it must be UTF8")
        if revision(engine) != HEAD:
            migrate(engine, HEAD)
    except DBAPIError as error:
        later = is_lost(error) and not _is_refused(error)
        kind = UnreachableError if later else StoreError
        raise kind(f"{make_url(url)}: {error.orig}") from None
    finally:
        engine.dispose()


def _is_refused(error: DBAPIError) -> bool:
    """Whether the server has refused us for good, not only while it starts."""
    message = str(error.orig)
    return "FATAL" in message and not any(text in message for text in _TEMPORARY)


@contextmanager
def _one_at_a_time(lock: Path) -> Iterator[None]:
    """Keep two programs that start together from making the same tables."""
    with lock.open("w", encoding="ascii") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _prepare_file(path: Path) -> None:
    replacement = path.with_name(path.name + _REPLACEMENT)
    if replacement.exists() and not path.exists():
        replacement.rename(path)  # Finished, and killed before it was renamed
    if (fault := _absence_of(path)) is not None:
        path.touch(mode=0o600)
        _replace(path, fault)
    elif path.exists() and (fault := _fault_of(path)) is not None:
        _replace(path, fault)
    integrity.clear_fault(path)
    _create_or_migrate(path)
    _log_lost_records(path)


def _absence_of(path: Path) -> str | None:
    """Return a fault if a database is missing whose write-ahead log still exists.

    SQLite would make a new file and delete the log without an error.
    """
    log = path.with_name(path.name + "-wal")
    if not log.exists() or not log.stat().st_size:
        return None
    if not path.exists():
        return "it is missing, and its write-ahead log still exists"
    return None if path.stat().st_size else "it is empty, and its write-ahead log still exists"


def _log_lost_records(path: Path) -> None:
    """Log which acknowledged records the database does not have; reuse no id."""
    marks = high_water.read(high_water.path_of(path))
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        (withdrawn,) = connection.execute("SELECT max(work_id) FROM withdrawn").fetchone()
        _count_from(connection, "work", max(marks.work, withdrawn or 0))
        newest = _count_from(connection, "telemetry", marks.record)
    if newest >= marks.record:
        return
    LOG.critical(
        "the database %s has no record after %d, but records up to %d were acknowledged:"
        " those from %d to %d are lost, except for what the cloud has confirmed of them",
        *(path, newest, marks.record, newest + 1, marks.record),
    )


def _count_from(connection: sqlite3.Connection, table: str, used: int) -> int:
    """Make a table's next id larger than `used`; returns the largest that the database had used."""
    query = "SELECT seq FROM sqlite_sequence WHERE name = ?"
    row = connection.execute(query, (table,)).fetchone()
    newest = int(row[0]) if row else 0
    if newest < used:
        connection.execute("DELETE FROM sqlite_sequence WHERE name = ?", (table,))
        connection.execute("INSERT INTO sqlite_sequence VALUES (?, ?)", (table, used))
    return newest


def _create_or_migrate(path: Path) -> None:
    """Create a missing file; bring it to our schema."""
    engine = open_engine(sqlite_url(path))
    try:
        if revision(engine) != HEAD:
            migrate(engine, HEAD)
    finally:
        engine.dispose()
    path.chmod(0o600)


def _replace(path: Path, fault: str) -> None:
    """Replace a broken database by a new one with all rows that can be recovered.

    The broken one stays until the new one is finished: a kill loses neither.
    """
    replacement = path.with_name(path.name + _REPLACEMENT)
    for end in ("", *_SIDE_FILES):
        replacement.with_name(replacement.name + end).unlink(missing_ok=True)
    _create_or_migrate(replacement)
    saved = recovery.recover(path, replacement)
    moved_to = set_aside(path, time.strftime("%Y%m%dT%H%M%S", time.gmtime()))
    replacement.rename(path)
    LOG.critical(
        "the database %s was broken (%s); it is kept as %s, and a new one was made with %s%s",
        path,
        fault,
        moved_to,
        ", ".join(f"{number} rows of {name}" for name, number in saved.rows.items()) or "no row",
        _loss(saved),
    )


def _loss(saved: recovery.Recovered) -> str:
    if saved.whole:
        return ""
    places = [
        f"{'records' if name == 'telemetry' else f'rows of {name}'} from {first} on"
        for name, first in saved.damaged_from.items()
    ]
    named = f" ({', '.join(places)})" if places else ""
    return f"; what could not be read{named} is lost, and no record of it has reached the cloud"


def is_ready(url: str) -> bool:
    """Whether the database exists and has our schema."""
    path = _file_of(url)
    if path is not None and (not path.exists() or integrity.noted_fault(path) is not None):
        return False
    engine = open_engine(url)
    try:
        return revision(engine) == HEAD
    except DBAPIError:
        return False
    finally:
        engine.dispose()


def revision(engine: Engine) -> str | None:
    """Return the revision of a database's schema; None if it is empty."""
    with engine.connect() as connection:
        return _revision(connection)


def _revision(connection: Connection) -> str | None:
    if not inspect(connection).has_table("alembic_version"):
        return None
    found: str | None = connection.execute(
        text("SELECT version_num FROM alembic_version")
    ).scalar_one_or_none()
    return found


def migrate(engine: Engine, target: str) -> None:
    """Change the schema of a database, up or down ("base" empties it), in one transaction."""
    # Alembic is needed rarely, and would cost memory in every process.
    from alembic import command  # noqa: PLC0415  # see above
    from alembic.config import Config  # noqa: PLC0415  # see above
    from alembic.script import ScriptDirectory  # noqa: PLC0415  # see above

    config = Config()
    config.set_main_option("script_location", str(_SCRIPTS).replace("%", "%%"))
    scripts = ScriptDirectory.from_config(config)
    known = [script.revision for script in scripts.walk_revisions()]
    with engine.execution_options(**WRITING).begin() as connection:
        _allow_long_waits(connection)
        locks.take(connection, [locks.MIGRATION])
        current = _revision(connection)
        if current is not None and current not in known:
            raise NewerDatabaseError(
                f"the database is at {current}, which this version does not know; use a newer one"
            )
        config.attributes["connection"] = connection
        if target == "base" or (current in known and known.index(current) < known.index(target)):
            command.downgrade(config, target)
        else:
            command.upgrade(config, target)


def _allow_long_waits(connection: Connection) -> None:
    """Wait for other programs to prepare or to end their transactions, and copy large tables."""
    if connection.dialect.name == "postgresql":
        for setting in ("lock_timeout", "statement_timeout"):
            connection.execute(
                text("SELECT set_config(:setting, '10min', true)"), {"setting": setting}
            ).close()


def set_aside(path: Path, stamp: str, folder: str = "quarantine") -> Path:
    """Move a database and its side files to a folder; returns where the database is now."""
    quarantine = path.parent / folder
    quarantine.mkdir(exist_ok=True, mode=0o700)
    moved_to = quarantine / f"{path.stem}-{stamp}{path.suffix}"
    number = 1
    while moved_to.exists():
        number += 1
        moved_to = quarantine / f"{path.stem}-{stamp}-{number}{path.suffix}"
    for side in _SIDE_FILES:
        if (file := path.with_name(path.name + side)).exists():
            file.rename(moved_to.with_name(moved_to.name + side))
    path.rename(moved_to)
    return moved_to


def _fault_of(path: Path) -> str | None:
    """Return what is wrong with a database file; None if a short check finds nothing."""
    if (noted := integrity.noted_fault(path)) is not None:
        return noted
    try:
        return integrity.fault_of(path, integrity.PATIENCE_S)
    except integrity.TakesTooLongError:
        LOG.info("the database is large; it is checked while the server runs")
        return None
