"""The broker's database: one SQLite file for everything that must survive the broker.

It knows rows, not what they mean: each table's bytes carry a checksum of their own and are encoded
by the package that uses them. Every change is one transaction, on the disk when it returns (WAL,
synchronous=FULL). One process writes, which the lock of the folder ensures; the command
`dead-letters` reads and adds requests.

A damaged file is renamed to `.bad`, and the rows that can still be read go to a new one. Some free
space is allocated in advance, in the file and in its log: on a full disk rows can still be removed,
and small ones be stored.

DatabaseBusyError  another broker uses the folder
"""

import errno
import fcntl
import logging
import os
import re
import sqlite3
import stat
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from ulid import ULID

DATABASE_FILE: Final = "broker.db"
LOCK_FILE: Final = "broker.lock"
"""It contains the broker's identity."""
VERSION: Final = 1
RESERVE_BYTES: Final = 512 << 10
"""Allocated in advance, in the file and in its log."""
BUSY_TIMEOUT_S: Final = 2.0
"""How long a change waits for the command that adds requests."""
CLOSE_TIMEOUT_S: Final = 5.0
"""How long an ending program waits for a slow disk."""

_IDENTITY: Final = re.compile(rb"[0-7][0-9A-HJKMNP-TV-Z]{25}")
_TABLES: Final = {"posts": 3, "dead_letters": 2, "requests": 3, "records": 3, "damaged": 3}
"""Number of columns by table."""
_SCHEMA: Final = f"""
BEGIN IMMEDIATE;
CREATE TABLE posts (
    number INTEGER PRIMARY KEY,
    is_picture INTEGER NOT NULL CHECK (is_picture IN (0, 1)),
    data BLOB NOT NULL
);
CREATE TABLE dead_letters (number INTEGER PRIMARY KEY, data BLOB NOT NULL);
CREATE TABLE requests (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    action TEXT NOT NULL CHECK (action IN ('retry', 'drop')),
    number INTEGER NOT NULL
);
CREATE TABLE records (
    system INTEGER NOT NULL,
    uid TEXT NOT NULL,
    data BLOB NOT NULL,
    PRIMARY KEY (system, uid)
);
CREATE TABLE damaged (source TEXT NOT NULL, reason TEXT NOT NULL, data BLOB);
PRAGMA user_version = {VERSION};
COMMIT;
"""
_PRAGMAS: Final = ("journal_mode=WAL", "synchronous=FULL", "secure_delete=OFF", "auto_vacuum=NONE")
_PAGE_BYTES: Final = 4096
_CHECKPOINT_PAGES: Final = 64
"""Size of the log at which it is emptied; it stays within the allocated space."""
_DAMAGE: Final = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)
_ERRNO: Final = {
    sqlite3.SQLITE_FULL: errno.ENOSPC,
    sqlite3.SQLITE_READONLY: errno.EROFS,
    sqlite3.SQLITE_BUSY: errno.EBUSY,
}

_LOG = logging.getLogger(__name__)


class DatabaseBusyError(OSError):
    """Another broker uses the folder."""


class Database:
    """The database of one broker, for all its threads; opened again after an error at opening."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.writes = 0  # Number of changes
        self._path = folder / DATABASE_FILE
        self._mutex = threading.Lock()
        self._lock: int | None = None
        self._connection: sqlite3.Connection | None = None
        self._is_closed = False
        self.instance_id = ""
        """Identifies the broker of this folder, also after a restart; empty if none is stored."""

    def open(self) -> None:
        """Lock the folder and open the file, which is created if there is none.

        Raises:
            DatabaseBusyError: if another broker has locked the folder.
            OSError: if it cannot be used.
        """
        with self._mutex, _as_os_errors():
            self._connected()

    def read(self, query: str) -> list[tuple[Any, ...]]:
        """Give the rows of a query, also of a file that cannot be changed now.

        Raises:
            DatabaseBusyError: if another broker has locked the folder.
            OSError: if they cannot be read.
        """
        with self._mutex:
            try:
                with _as_os_errors():
                    return self._connected().execute(query).fetchall()
            except DatabaseBusyError:
                raise
            except OSError:  # Its opening alone writes: on a read-only disk, or beside a lock
                if self._is_closed or not self._path.exists():
                    raise
                with suppress(OSError):
                    return read_rows(self.folder, query)
                raise  # A file without tables says less than the disk that refused them

    @contextmanager
    def change(self, size_bytes: int = 0) -> Iterator[sqlite3.Connection]:
        """Change rows, all or none; they are on the disk at the end.

        `size_bytes`: of the rows that are added, 0 for rows that may use the reserve.

        Raises:
            OSError: if the disk refuses; nothing is changed then.
        """
        with self._mutex, _as_os_errors():
            connection = self._connected()
            self.writes += 1
            if size_bytes:
                self._require_space(connection, 2 * size_bytes + RESERVE_BYTES // 4)
            try:
                connection.execute("BEGIN IMMEDIATE")
                yield connection
                connection.execute("COMMIT")
            except BaseException as error:
                if connection.in_transaction:
                    connection.execute("ROLLBACK")
                if _is_damage(error):
                    self._disconnect()  # The next change sets the damaged file aside
                raise

    def set_aside(self, table: str, row_id: int, reason: str) -> None:
        """Move a row that is not valid to the table `damaged`; it stays if the disk refuses."""
        _LOG.warning("%s: row %d of %s is set aside: %s", self._path, row_id, table, reason)
        query = f"INSERT INTO damaged SELECT ?, ?, data FROM {table} WHERE rowid = ?"  # noqa: S608
        try:
            with self.change() as rows:
                rows.execute(query, (table, reason, row_id))
                rows.execute(f"DELETE FROM {table} WHERE rowid = ?", (row_id,))  # noqa: S608
        except OSError as error:
            _LOG.warning("%s: the row stays: %s", self._path, error.strerror)

    def close(self) -> None:
        """Close the file and unlock the folder, unless the disk does not answer."""
        if not self._mutex.acquire(timeout=CLOSE_TIMEOUT_S):
            return
        with suppress(sqlite3.Error):
            self._disconnect()
        self._is_closed = True
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None
        self._mutex.release()

    def _connected(self) -> sqlite3.Connection:
        if self._is_closed:
            raise OSError(errno.EBADF, "the database is closed")
        if self._connection is not None and not self._path.exists():
            _LOG.warning("%s was removed: it is written again", self._path)
            self._replace(self._connection)
            self._disconnect()
        if self._connection is None:
            self.folder.mkdir(parents=True, exist_ok=True)
            if self._lock is None:
                self._lock = _lock(self.folder / LOCK_FILE)
                self.instance_id = _identity(self._lock)
            self._connection = self._opened()
        return self._connection

    def _require_space(self, connection: sqlite3.Connection, size_bytes: int) -> None:
        """Refuse rows for which a full disk has no space in the file: its log could not shrink."""
        pages = connection.execute("PRAGMA freelist_count").fetchone()[0]
        disk = os.statvfs(self.folder)
        if max(pages * _PAGE_BYTES, disk.f_bavail * disk.f_frsize) < size_bytes:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def _disconnect(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()

    def _opened(self) -> sqlite3.Connection:
        copy = _beside(self._path, ".new")
        if copy.exists() and not self._path.exists():
            copy.replace(self._path)  # An earlier run was killed while it replaced the file
        _create(self._path)
        connection = _connect(self._path)
        try:
            damage = _damage(connection)
            if damage:
                _LOG.error(
                    "%s is damaged: %s; it is renamed to %s, what can be read is kept",
                    *(self._path, damage, _beside(self._path, ".bad").name),
                )
                self._replace(connection)
                connection.close()
                connection = _connect(self._path)
            _prepare(connection)
        except BaseException:
            connection.close()
            raise
        return connection

    def _replace(self, connection: sqlite3.Connection) -> None:
        """Put a new file with the readable rows in place of the present one.

        The new one is complete before it gets its name, so a kill in between loses nothing.
        """
        copy, rejected = _beside(self._path, ".new"), _beside(self._path, ".bad")
        _remove(copy)
        _create(copy)
        fresh = _connect(copy)
        try:
            _prepare(fresh)
            fresh.execute("BEGIN IMMEDIATE")
            for table, columns in _TABLES.items():
                marks = ", ".join("?" * columns)
                statement = f"INSERT OR IGNORE INTO {table} VALUES ({marks})"  # noqa: S608
                fresh.executemany(statement, _readable_rows(connection, table, columns))
            fresh.execute("COMMIT")
        finally:
            fresh.close()
        _remove(rejected)
        for ending in ("-wal", ""):
            with suppress(FileNotFoundError):
                _beside(self._path, ending).replace(_beside(rejected, ending))
        _remove(self._path)
        copy.replace(self._path)
        _sync_folder(self.folder)


def read_rows(folder: Path, query: str) -> list[tuple[Any, ...]]:
    """Give the rows of a query, also beside a running broker or on a read-only disk.

    No rows if there is no database.

    Raises:
        OSError: if they cannot be read.
    """
    path = folder / DATABASE_FILE
    if not path.exists():
        return []
    with _as_os_errors():
        try:
            return _rows(path, "ro", query)
        except sqlite3.OperationalError:  # No log, and none can be created beside it
            return _rows(path, "ro&immutable=1", query)


def add_requests(folder: Path, action: str, numbers: Sequence[int]) -> None:
    """Add requests to `retry` or `drop` dead letters to an existing database.

    Raises:
        OSError: if the disk refuses.
    """
    with _as_os_errors():
        connection = _connect(folder / DATABASE_FILE)
        try:
            _set_up(connection)
            connection.execute("BEGIN IMMEDIATE")
            connection.executemany(
                "INSERT INTO requests (action, number) VALUES (?, ?)",
                [(action, number) for number in numbers],
            )
            connection.execute("COMMIT")
        finally:
            connection.close()


@contextmanager
def _as_os_errors() -> Iterator[None]:
    try:
        yield
    except sqlite3.Error as error:
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        raise OSError(_ERRNO.get(code, errno.EIO), str(error)) from error


def _connect(path: Path, mode: str = "rw") -> sqlite3.Connection:
    connection = sqlite3.connect(
        f"{path.absolute().as_uri()}?mode={mode}",
        uri=True,
        timeout=BUSY_TIMEOUT_S,
        isolation_level=None,
        check_same_thread=False,
    )
    connection.text_factory = lambda text: text.decode(errors="replace")  # Damage is no error here
    return connection


def _rows(path: Path, mode: str, query: str) -> list[tuple[Any, ...]]:
    connection = _connect(path, mode)
    try:
        return connection.execute(query).fetchall()
    finally:
        connection.close()


def _set_up(connection: sqlite3.Connection) -> None:
    for pragma in (*_PRAGMAS, f"wal_autocheckpoint={_CHECKPOINT_PAGES}"):
        connection.execute(f"PRAGMA {pragma}")


def _prepare(connection: sqlite3.Connection) -> None:
    """Create missing tables, and allocate the reserve where the disk has space."""
    _set_up(connection)
    if not _version(connection):
        connection.executescript(_SCHEMA)
    try:
        connection.execute("BEGIN IMMEDIATE")
        connection.execute("INSERT INTO damaged VALUES ('', '', zeroblob(?))", (RESERVE_BYTES,))
        connection.execute("COMMIT")
    except sqlite3.OperationalError as error:
        _LOG.warning("there is no space for the reserve of the broker's database: %s", error)
        if connection.in_transaction:
            connection.execute("ROLLBACK")
    connection.execute("DELETE FROM damaged WHERE source = ''")


def _version(connection: sqlite3.Connection) -> int:
    return int(connection.execute("PRAGMA user_version").fetchone()[0])


def _damage(connection: sqlite3.Connection) -> str:
    """Describe the damage of a file; empty if it has none."""
    try:
        found = str(connection.execute("PRAGMA quick_check(1)").fetchone()[0])
        version = _version(connection)
        tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_schema")}
    except sqlite3.DatabaseError as error:
        if not _is_damage(error):
            raise
        return str(error)
    if found != "ok":
        return found
    if version not in (0, VERSION) or (version and not tables >= _TABLES.keys()):
        return f"its version is {version}, not {VERSION}"
    return "" if version or not tables else "it is the database of another program"


def _is_damage(error: BaseException) -> bool:
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in _DAMAGE


def _readable_rows(
    connection: sqlite3.Connection, table: str, columns: int
) -> list[tuple[Any, ...]]:
    """Read rows from both ends of a table up to the first that cannot be read."""
    rows: dict[tuple[Any, ...], None] = {}
    for order in ("ASC", "DESC"):
        with suppress(sqlite3.Error):
            query = f"SELECT * FROM {table} ORDER BY rowid {order}"  # noqa: S608  # constants
            for row in connection.execute(query):
                rows[row] = None
    return [row for row in rows if len(row) == columns]


def _beside(path: Path, ending: str) -> Path:
    return path.with_name(path.name + ending)


def _remove(path: Path) -> None:
    for ending in ("", "-wal", "-shm"):
        _beside(path, ending).unlink(missing_ok=True)


def _create(path: Path) -> None:
    """Create a file for the broker alone, unless it exists; a link, pipe or folder is refused."""
    flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    descriptor = os.open(path, flags, 0o600)
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, f"{path} is not a regular file")
    finally:
        os.close(descriptor)
    _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    """Make a new name in the folder survive a loss of power."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _lock(path: Path) -> int:
    """Lock the folder; the lock ends with the process.

    Raises:
        DatabaseBusyError: if another process has locked it.
        OSError: if it cannot be locked.
    """
    flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    descriptor = os.open(path, flags, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise DatabaseBusyError(errno.EBUSY, f"another broker uses {path.parent}") from None
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def _identity(lock: int) -> str:
    """Read the identity in a lock file; a file without one gets a new one.

    Empty if the disk refuses: a broker with another identity after each restart would wait until
    the edge server takes its predecessor for gone.
    """
    new = str(ULID()).encode()
    try:
        known = os.pread(lock, 64, 0)
        if _IDENTITY.fullmatch(known):
            return known.decode()
        os.ftruncate(lock, 0)
        is_complete = os.pwrite(lock, new, 0) == len(new)
        os.fsync(lock)
    except OSError:
        return ""
    return new.decode() if is_complete else ""
