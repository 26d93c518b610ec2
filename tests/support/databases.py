"""Databases to test on: a file of SQLite, or a real PostgreSQL server of this test run.

The server runs as an unprivileged user in a temporary folder, listens on a socket in it and on no
port, and does not wait for the disk: it is killed with the run, never by a power cut. A test finds
a database that is as new: what earlier ones left is cut off and taken out, which costs a fifth of
a new database.
"""

import atexit
import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

import psycopg
import pytest
from sqlalchemy import Connection, func, select

from edge_server.store import migrate
from edge_server.store.connection.engines import sqlite_url
from edge_server.store.rows.tables import outbox
from tests.support.system import wait_for

ENGINES = ("sqlite", "postgresql")
BOTH_ENGINES = pytest.mark.parametrize("engine_name", ENGINES, indirect=True)
"""Mark of tests that run on each engine where they would run on SQLite alone."""
USER = "edge"
_FAST = {
    "listen_addresses": "",
    "fsync": "off",
    "full_page_writes": "off",
    "shared_buffers": "16MB",
    "autovacuum": "off",
    "max_connections": "150",
    "log_min_messages": "fatal",
}

_CUT_OTHERS = (
    "SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
    "WHERE datname = current_database() AND pid <> pg_backend_pid()"
)


def count_outbox(connection: Connection) -> int:
    """Count the records that the cloud has not confirmed, dead letters too."""
    return connection.execute(select(func.count()).select_from(outbox)).scalar_one()


def empty_sqlite(path: Path) -> str:
    """Put a database with our tables at a path, as `migrate.prepare` does; gives its URL."""
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    shutil.copy(_template(), path)
    return sqlite_url(path)


@cache
def _template() -> Path:
    """Make the tables once in this process: that costs a hundred times as much as a copy."""
    folder = Path(tempfile.mkdtemp(prefix="template-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    migrate.prepare(sqlite_url(folder / "edge.sqlite3"))
    return folder / "edge.sqlite3"


def binaries() -> Path:
    """Where initdb and postgres lie: on the path, or where Debian puts them."""
    if found := shutil.which("initdb"):
        return Path(found).resolve().parent
    versions = Path("/usr/lib/postgresql").glob("*/bin/initdb")
    newest = max(versions, key=lambda path: int(path.parent.parent.name), default=None)
    assert newest is not None, "PostgreSQL is not installed: apt-get install postgresql"
    return newest.parent


def _unprivileged() -> dict[str, Any]:
    """User that the server runs as: PostgreSQL refuses to run as root."""
    if os.geteuid() != 0:
        return {}
    names = {entry.pw_name for entry in pwd.getpwall()}
    user = pwd.getpwnam("postgres" if "postgres" in names else "nobody")
    return {"user": user.pw_uid, "group": user.pw_gid, "extra_groups": []}


class PostgresServer:
    """A server that can be started, stopped, killed and started again over its data."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._data = folder / "data"
        self._identity = _unprivileged()
        self._process: subprocess.Popen[bytes] | None = None
        self._numbers = count()
        self._as_new: dict[str, str] = {}
        if self._identity:
            os.chown(folder, self._identity["user"], self._identity["group"])
        folder.chmod(0o755)
        options = ["-U", USER, "-A", "trust", "-E", "UTF8", "--locale=C", "-N"]
        self._run("initdb", "-D", self._data, *options)

    def _run(self, name: str, *arguments: object) -> None:
        subprocess.run(
            [binaries() / name, *map(str, arguments)],
            check=True,
            capture_output=True,
            cwd=self.folder,
            **self._identity,
        )

    def start(self) -> None:
        """Serve, and wait until it answers."""
        settings = _FAST | {"unix_socket_directories": str(self.folder)}
        self._process = subprocess.Popen(
            [
                str(binaries() / "postgres"),
                "-D",
                str(self._data),
                *(f"--{name}={value}" for name, value in settings.items()),
            ],
            cwd=self.folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            **self._identity,
        )
        wait_for(self.answers, "PostgreSQL's first answer")

    def answers(self) -> bool:
        """Whether one can connect."""
        try:
            self._connect().close()
        except psycopg.OperationalError:
            return False
        return True

    def stop(self) -> None:
        """End at once, cutting every connection."""
        if self._process is not None:
            self._run("pg_ctl", "stop", "-D", self._data, "-m", "immediate", "-w")
            self._process.wait()
            self._process = None

    def url(self, name: str) -> str:
        """Give the URL of one of its databases."""
        return f"postgresql+psycopg://{USER}@/{name}?host={self.folder}"

    def create(self, template: str = "template0", name: str | None = None) -> str:
        """Make a database; returns its name."""
        name = name or f"test_{next(self._numbers)}"
        self.administer(f"CREATE DATABASE {name} TEMPLATE {template} STRATEGY file_copy")
        return name

    def keep(self, name: str) -> None:
        """Remember what a database holds, so that it can be as it is now again and again."""
        listed = self.administer(
            "SELECT tablename FROM pg_tables WHERE schemaname = 'public' "
            "AND tablename <> 'alembic_version'",
            name,
        )
        tables = [str(row[0]) for row in listed]
        self.administer("CREATE SCHEMA kept", name)
        for table in tables:
            self.administer(f"CREATE TABLE kept.{table} AS TABLE public.{table}", name)
        filled = [t for t in tables if self.administer(f"SELECT 1 FROM {t} LIMIT 1", name)]
        self._as_new[name] = "; ".join(
            [
                _CUT_OTHERS,
                f"TRUNCATE {', '.join(tables)} RESTART IDENTITY",
                *(f"INSERT INTO {table} SELECT * FROM kept.{table}" for table in filled),
            ]
        )

    def renew(self, name: str) -> None:
        """Bring a database back to what it held at `keep`, and end its connections."""
        self.administer(self._as_new[name], name)

    def drop(self, name: str) -> None:
        """Remove a database, ending its connections."""
        self.administer(f"DROP DATABASE {name} WITH (FORCE)")

    def administer(self, statement: str, database: str = "postgres") -> list[tuple[Any, ...]]:
        """Run a statement as the database's owner; returns what it gives."""
        with self._connect(database) as connection:
            cursor = connection.execute(statement.encode())
            return cursor.fetchall() if cursor.description else []

    def _connect(self, database: str = "postgres") -> psycopg.Connection[tuple[Any, ...]]:
        return psycopg.connect(
            host=str(self.folder), user=USER, dbname=database, autocommit=True, connect_timeout=10
        )


@contextmanager
def running_server() -> Iterator[PostgresServer]:
    """Run a server for a while."""
    # Not below pytest's own folder: its parents are closed to other users, and sockets' names short
    folder = Path(tempfile.mkdtemp(prefix="edge-pg-"))
    server = PostgresServer(folder)
    try:
        server.start()
        yield server
    finally:
        server.stop()
        shutil.rmtree(folder)
