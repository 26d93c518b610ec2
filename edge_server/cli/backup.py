"""Copies the database while it is in use: complete, as of one moment.

BackupError  the copy could not be made; no file was left
"""

import os
import sqlite3
import sys
from contextlib import closing
from pathlib import Path

from edge_server.config import Config
from edge_server.process.exit_codes import FAILED, OK, WRONG_SETUP


class BackupError(Exception):
    """The copy could not be made."""


def run(config: Config, target: Path) -> int:
    """Run the command `backup`; returns the exit code."""
    if config.database_url is not None:
        print(
            f"edge server: there is no database file to copy: {config.database_name} is backed up "
            "with pg_dump",
            file=sys.stderr,
        )
        return WRONG_SETUP
    try:
        size = back_up(config.database_path, target)
    except BackupError as error:
        print(f"edge server: {error}", file=sys.stderr)
        return FAILED
    print(f"{target}: {size} bytes")
    return OK


def back_up(database: Path, target: Path) -> int:
    """Copy the database into a new file with mode 0600; returns its size [bytes].

    Raises:
        BackupError: if there is no database, the target exists, or the disk fails.
    """
    if not database.exists():
        raise BackupError(f"there is no database {database}")
    if target.exists():
        raise BackupError(f"{target} exists; a backup overwrites nothing")
    part = target.with_name(target.name + ".part")
    try:
        _copy(database, part)
        os.link(part, target)  # Unlike a rename it fails if the target exists by now
        _sync(target.parent)
    except (OSError, sqlite3.Error) as error:
        raise BackupError(f"cannot write {target}: {error}") from None
    finally:
        part.unlink(missing_ok=True)
    return target.stat().st_size


def _copy(database: Path, part: Path) -> None:
    part.unlink(missing_ok=True)
    os.close(os.open(part, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600))
    with (
        closing(sqlite3.connect(f"{database.absolute().as_uri()}?mode=ro", uri=True)) as source,
        closing(sqlite3.connect(part)) as copy,
    ):
        # In one step, which reads one state while others write (WAL). Between two steps SQLite
        # would begin again for each commit, and with many commits a second it would never end.
        source.backup(copy, pages=-1)
        (found,) = copy.execute("PRAGMA quick_check(1)").fetchone()
        if found != "ok":
            raise sqlite3.DatabaseError(f"the copy is broken: {found}")
    _sync(part)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
