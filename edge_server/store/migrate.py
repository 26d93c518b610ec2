"""Brings a database to the shape that this version of the program needs.

StoreError
  +- NewerDatabaseError  made by a newer version; this one must not touch it
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

from edge_server.store import high_water, integrity, locks, recovery
from edge_server.store.engines import WRITING, open_engine, sqlite_url
from edge_server.store.failures import is_lost

LOG = logging.getLogger(__name__)
HEAD: Final = "0011"
_SCRIPTS: Final = Path(__file__).parent / "migrations"
_REPLACEMENT: Final = ".new"
_PASSING: Final = ("starting up", "shutting down", "recovery", "too many", "not yet", "terminating")
"""What a server says that will let us in later; a connection that fails carries no SQLSTATE."""
_SIDE_FILES: Final = ("-wal", "-shm", "-journal")


class StoreError(Exception):
    """The database cannot be used."""


class NewerDatabaseError(StoreError):
    """The database was made by a newer version."""


class UnreachableError(StoreError):
    """The database server does not answer; later it may."""


def prepare(url: str) -> None:
    """Make the tables if they are missing, bring them up to date; set a broken file aside.

    Programs that start together wait for each other.

    Raises:
        NewerDatabaseError: if a newer version has made it.
        UnreachableError: if it is PostgreSQL and does not answer now.
        StoreError: if it will not let us in, or cannot hold our text.
    """
    path = _file_of(url)
    if path is None:
        _prepare_server(url)
        return
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    with _one_at_a_time(path.parent / "prepare.lock"):
        _prepare_file(path)


def _file_of(url: str) -> Path | None:
    """Give the file of a SQLite database, None for a server's."""
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
    """Whether the server has answered, and it is not that it has just been started."""
    said = str(error.orig)
    return "FATAL" in said and not any(word in said for word in _PASSING)


@contextmanager
def _one_at_a_time(lock: Path) -> Iterator[None]:
    """Keep two programs that start together from making the same tables."""
    with lock.open("w", encoding="ascii") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _prepare_file(path: Path) -> None:
    replacement = path.with_name(path.name + _REPLACEMENT)
    if replacement.exists() and not path.exists():
        replacement.rename(path)  # Finished, and killed before it stood in its place
    if (fault := _absence_of(path)) is not None:
        path.touch(mode=0o600)
        _replace(path, fault)
    elif path.exists() and (fault := _fault_of(path)) is not None:
        _replace(path, fault)
    integrity.forget_fault(path)
    _bring_up(path)
    _tell_of_lost(path)


def _absence_of(path: Path) -> str | None:
    """Say that a database is gone whose log of changes is still here.

    SQLite would make a new file and forget the log without a word.
    """
    log = path.with_name(path.name + "-wal")
    if not log.exists() or not log.stat().st_size:
        return None
    if not path.exists():
        return "it is gone, and its log of changes is still here"
    return None if path.stat().st_size else "it is empty, and its log of changes is still here"


def _tell_of_lost(path: Path) -> None:
    """Say which records were acknowledged and are unknown to the database; use no id twice."""
    marks = high_water.read(high_water.path_of(path))
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        (withdrawn,) = connection.execute("SELECT max(work_id) FROM withdrawn").fetchone()
        _count_from(connection, "work", max(marks.work, withdrawn or 0))
        newest = _count_from(connection, "telemetry", marks.record)
    if newest >= marks.record:
        return
    LOG.critical(
        "the database %s knows no record after %d, and records up to %d were acknowledged:"
        " those from %d to %d are lost, except for what the cloud has confirmed of them",
        *(path, newest, marks.record, newest + 1, marks.record),
    )


def _count_from(connection: sqlite3.Connection, table: str, used: int) -> int:
    """Give a table's next row an id beyond `used`; returns the largest that the database knew."""
    query = "SELECT seq FROM sqlite_sequence WHERE name = ?"
    row = connection.execute(query, (table,)).fetchone()
    newest = int(row[0]) if row else 0
    if newest < used:
        connection.execute("DELETE FROM sqlite_sequence WHERE name = ?", (table,))
        connection.execute("INSERT INTO sqlite_sequence VALUES (?, ?)", (table, used))
    return newest


def _bring_up(path: Path) -> None:
    """Make a file that is missing; give it our shape."""
    engine = open_engine(sqlite_url(path))
    try:
        if revision(engine) != HEAD:
            migrate(engine, HEAD)
    finally:
        engine.dispose()
    path.chmod(0o600)


def _replace(path: Path, fault: str) -> None:
    """Put a new database in the place of a broken one, with all rows that can be saved.

    The broken one stays in its place until the new one is finished: a kill loses neither.
    """
    replacement = path.with_name(path.name + _REPLACEMENT)
    for end in ("", *_SIDE_FILES):
        replacement.with_name(replacement.name + end).unlink(missing_ok=True)
    _bring_up(replacement)
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
    """Whether the database is there and in the shape that we need."""
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
    """Give the shape of a database; None when it is empty."""
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
    """Change the shape of a database, up or down ("base" empties it); all of it or nothing."""
    # Alembic is needed once in a database's life; it would cost memory in every process.
    from alembic import command  # noqa: PLC0415  # see above
    from alembic.config import Config  # noqa: PLC0415  # see above
    from alembic.script import ScriptDirectory  # noqa: PLC0415  # see above

    config = Config()
    config.set_main_option("script_location", str(_SCRIPTS).replace("%", "%%"))
    scripts = ScriptDirectory.from_config(config)
    known = [script.revision for script in scripts.walk_revisions()]
    with engine.execution_options(**WRITING).begin() as connection:
        _let_it_take_its_time(connection)
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


def _let_it_take_its_time(connection: Connection) -> None:
    """Wait for other programs to prepare or to end their transactions, and copy large tables."""
    if connection.dialect.name == "postgresql":
        for setting in ("lock_timeout", "statement_timeout"):
            connection.execute(
                text("SELECT set_config(:setting, '10min', true)"), {"setting": setting}
            ).close()


def set_aside(path: Path, stamp: str) -> Path:
    """Move a database and its side files to quarantine; returns where the database is now."""
    quarantine = path.parent / "quarantine"
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
    """Say what is wrong with a database file; None when it is whole, as far as a look tells."""
    if (noted := integrity.noted_fault(path)) is not None:
        return noted
    try:
        return integrity.fault_of(path, integrity.PATIENCE_S)
    except integrity.TakesTooLongError:
        LOG.info("the database is large; it is checked while the server runs")
        return None
