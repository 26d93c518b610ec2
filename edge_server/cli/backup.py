"""The commands `backup` and `restore`.

RestoreError  the copy could not be put back; the database is what it was
"""

import os
import shutil
import sqlite3
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import Final

from edge_server.config import Config
from edge_server.process.exit_codes import FAILED, OK, WRONG_SETUP
from edge_server.store import migrate
from edge_server.store.files.backup import BackupError, back_up, delete_older, file_in, sync
from edge_server.store.files.restored_work import hold_missions

_REPLACED: Final = "replaced"
"""Folder of the databases that a restoration has replaced."""


class RestoreError(Exception):
    """The copy could not be put back."""


def run(config: Config, target: Path, keep: int | None = None) -> int:
    """Run the command `backup`; returns the exit code.

    In a folder the file is named after the time of day (UTC); of those files the newest `keep`
    stay.
    """
    if config.database_url is not None:
        print(
            f"edge server: there is no database file to copy: {config.database_name} is backed up "
            "with pg_dump",
            file=sys.stderr,
        )
        return WRONG_SETUP
    folder = target if target.is_dir() else None
    if keep is not None and folder is None:
        print(f"edge server: --keep: {target} is not a folder", file=sys.stderr)
        return WRONG_SETUP
    file = target if folder is None else file_in(folder, time.time())
    try:
        size = back_up(config.database_path, file)
        if keep is not None and folder is not None:
            delete_older(folder, keep)
    except BackupError as error:
        print(f"edge server: {error}", file=sys.stderr)
        return FAILED
    print(f"{file}: {size} bytes")
    return OK


def run_restore(config: Config, source: Path) -> int:
    """Run the command `restore`; returns the exit code."""
    if config.database_url is not None:
        print(
            f"edge server: there is no database file to replace: {config.database_name} is "
            "restored with pg_restore",
            file=sys.stderr,
        )
        return WRONG_SETUP
    try:
        kept, held = restore(config.database_path, source)
    except RestoreError as error:
        print(f"edge server: {error}", file=sys.stderr)
        return FAILED
    kept_as = "" if kept is None else f"; the former one is {kept}"
    print(f"{config.database_path} is the copy {source}{kept_as}")
    if held:
        print(
            f"{held} missions that had not begun are held: since the backup they may have been "
            "flown, cancelled or aborted. Dispatch those that are still to be flown"
        )
    return OK


def restore(database: Path, source: Path) -> tuple[Path | None, int]:
    """Put a copy in the place of the database.

    Returns where the former one is, if there was one, and how many missions are held.

    Raises:
        RestoreError: if the copy is broken or no database of an edge server, a program uses the
            database, or the disk fails.
    """
    _check_copy(source)
    try:
        database.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        part = database.with_name(database.name + ".part")
        part.unlink(missing_ok=True)
        os.close(os.open(part, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600))
        shutil.copyfile(source, part)
        held = hold_missions(part)
        sync(part)
        kept = None
        if database.exists():
            _close(database)
            stamp = time.strftime("%Y%m%dT%H%M%S", time.gmtime())
            kept = migrate.set_aside(database, stamp, _REPLACED)
        part.rename(database)
        sync(database.parent)
    except (OSError, sqlite3.Error) as error:
        raise RestoreError(f"cannot replace {database}: {error}") from None
    return kept, held


def _check_copy(source: Path) -> None:
    if not source.is_file():
        raise RestoreError(f"there is no copy {source}")
    uri = f"{source.absolute().as_uri()}?mode=ro&immutable=1"
    try:
        with closing(sqlite3.connect(uri, uri=True)) as copy:
            (found,) = copy.execute("PRAGMA quick_check(1)").fetchone()
            copy.execute("SELECT version_num FROM alembic_version").fetchone()
    except sqlite3.Error as error:
        raise RestoreError(f"{source} is not a database of an edge server: {error}") from None
    if found != "ok":
        raise RestoreError(f"{source} is broken: {found}")


def _close(database: Path) -> None:
    """Write the log into the database, which fails while another program has it open."""
    try:
        with closing(sqlite3.connect(database, timeout=0.0, isolation_level=None)) as connection:
            connection.execute("PRAGMA journal_mode = DELETE").fetchone()
    except sqlite3.OperationalError:
        raise RestoreError(f"{database} is in use: stop server and relay first") from None
    except sqlite3.DatabaseError:
        return  # It is broken, which may be the reason for the restoration
