"""Transactions on SQLite or PostgreSQL: durable, exclusive where they must be, all or nothing."""

import json
import sqlite3
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, suppress
from contextvars import ContextVar
from enum import StrEnum
from functools import cache
from importlib import import_module
from typing import Any, Final, Generic, TypeVar

from sqlalchemy import Connection, CursorResult, Engine, Insert, Select, Table
from sqlalchemy.exc import DBAPIError

from edge_server.store.connection import locks
from edge_server.store.connection.engines import BUSY_TIMEOUT_MS, READING, WRITING
from edge_server.store.connection.failures import is_unwritable
from edge_server.store.connection.locks import Lock

TransactionHook = Callable[[Connection], AbstractContextManager[None]]
_T = TypeVar("_T")
_FEW_ROWS: Final = 4
_TEND_TIMEOUT_MS: Final = 100
_GROUP: Final = 64
"""Jobs in one transaction, at most."""
TRANSACTION_HOOK: Final[ContextVar[TransactionHook | None]] = ContextVar(
    "transaction_hook", default=None
)
"""The context manager around every writing transaction of this thread.

What it writes at its end belongs to the transaction: both are committed, or neither.
"""


class Topic(StrEnum):
    """Topic of a notice from one program on a database to the others."""

    WORK = "work"  # There is new work for a broker
    DUE = "due"  # Records were added
    CHANGED = "changed"  # Existing records were changed or deleted


class _Job(Generic[_T]):
    """A job that waits for the writer lock."""

    __slots__ = ("alone", "done", "result", "work")

    result: _T

    def __init__(self, work: Callable[[Connection], _T]) -> None:
        self.work = work
        self.done = False
        self.alone = False  # Its group has failed, so it runs alone


class _WriterLock:
    """The lock of a SQLite file's one writer; a thread that has it may not acquire it again.

    A transaction within a transaction would wait for itself for ever.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._holder: int | None = None

    def __enter__(self) -> None:
        """Wait for the lock; raises RuntimeError if this thread has it already."""
        if self._holder == threading.get_ident():
            raise RuntimeError("a transaction that writes was begun within another one")
        self._lock.acquire()
        self._holder = threading.get_ident()

    def __exit__(self, *_: object) -> None:
        """Release the lock."""
        self._holder = None
        self._lock.release()


class Database:
    """Transactions on one engine; safe to use from several threads."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self.is_shared = engine.dialect.name == "postgresql"
        """Whether other programs on other machines may work on it too."""
        self._writer = engine.execution_options(**WRITING)
        self._reader = engine.execution_options(**READING) if self.is_shared else engine
        # SQLite's own wait for the writer sleeps in steps of up to 100 ms; this lock does not.
        self._writer_lock = None if self.is_shared else _WriterLock()
        self._jobs: deque[_Job[Any]] = deque()
        self._sender_lock = threading.Lock()
        self._sender: Any = None
        self._listener: Any = None
        self._refused_at: float | None = None  # By the disk, the last time; None: not since
        self._was_stored = True  # The last transaction, as far as the disk decides that

    def was_refused(self, within_s: float) -> bool:
        """Whether the disk has refused the last transaction, or any within some time.

        On a full disk a small change may be stored where a record is not.
        """
        at = self._refused_at
        return not self._was_stored or (at is not None and time.monotonic() - at < within_s)

    @contextmanager
    def _note_outcome(self) -> Iterator[None]:
        try:
            yield
        except DBAPIError as error:
            if is_unwritable(error):
                self._refused_at, self._was_stored = time.monotonic(), False
            raise
        self._was_stored = True

    @contextmanager
    def write(self, *wanted: Lock) -> Iterator[Connection]:
        """Open a writing transaction, which is committed as a whole or not at all.

        It holds the `wanted` locks from its beginning to its end.
        """
        hook = TRANSACTION_HOOK.get()
        with ExitStack() as stack:
            stack.enter_context(self._note_outcome())
            if self._writer_lock is not None:
                stack.enter_context(self._writer_lock)
            connection = stack.enter_context(self._writer.begin())
            locks.take(connection, wanted)
            if hook is not None:
                stack.enter_context(hook(connection))
            yield connection

    def write_together(self, work: Callable[[Connection], _T], *wanted: Lock) -> _T:
        """Do a piece of work in a transaction that it may share with concurrent ones.

        On SQLite every commit waits for the disk. The thread that gets the writer lock does all
        queued jobs and commits them as one; a single job waits for no other. If a job of a group
        fails, each of them is repeated alone, so that a failure affects its own caller only.
        """
        if self._writer_lock is None or TRANSACTION_HOOK.get() is not None:
            with self.write(*wanted) as connection:
                return work(connection)
        job = _Job(work)
        self._jobs.append(job)
        with self._writer_lock:
            while not job.done:  # Its group may come after another one
                with suppress(Exception):  # Raised again below, by the job that failed
                    self._do_jobs()
        if job.alone:
            with self.write(*wanted) as connection:
                return work(connection)
        return job.result

    def _do_jobs(self) -> None:
        """Do a group of queued jobs and commit them as one."""
        group = [self._jobs.popleft() for _ in range(min(len(self._jobs), _GROUP))]
        kept = False
        try:
            with self._writer.begin() as connection:
                for job in group:
                    job.result = job.work(connection)
            kept = self._was_stored = True
        finally:
            for job in group:
                job.alone, job.done = not kept, True

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """Open a reading transaction, which sees one state of the database."""
        with self._reader.connect() as connection:
            yield connection

    def tend(self, work: Callable[[sqlite3.Connection], _T]) -> _T:
        """Maintain a SQLite file outside of a transaction, while no thread of this process writes.

        It does not wait long for other processes.

        Raises:
            DBAPIError: if it could not be done, as any other transaction raises it:
                OperationalError for a busy or full file, DatabaseError for a broken one.
        """
        if self._writer_lock is None:
            raise TypeError("a database server maintains itself")
        try:
            with self._writer_lock, closing(self.engine.raw_connection()) as pooled:
                connection: Any = pooled.driver_connection
                connection.execute(f"PRAGMA busy_timeout={_TEND_TIMEOUT_MS}")
                try:
                    return work(connection)
                finally:
                    connection.execute(f"PRAGMA busy_timeout={BUSY_TIMEOUT_MS}")
        except sqlite3.Error as error:
            raise DBAPIError.instance(None, None, error, sqlite3.Error) from error

    def announce(self, topic: Topic) -> None:
        """Notify the other programs on a shared database; call after the commit."""
        if not self.is_shared:
            return
        with self._sender_lock:
            if self._sender is None:
                from edge_server.store.connection.postgresql import Sender  # noqa: PLC0415  # loads psycopg

                self._sender = Sender(self.engine)
        self._sender.send(topic)

    def listen(
        self, on_notice: Callable[[str], None], at_end: Callable[[], None] = lambda: None
    ) -> None:
        """Call `on_notice`, in a thread of its own, for notices of other programs on the database.

        `at_end` is called after the last notice, when the database is closed.
        """
        if self.is_shared:
            from edge_server.store.connection.postgresql import Listener  # noqa: PLC0415  # as above

            missed = (Topic.CHANGED, Topic.WORK)
            self._listener = Listener(self.engine, on_notice, at_end, missed).start()

    def close(self) -> None:
        """Send the waiting notices, then close all connections."""
        for part in (self._sender, self._listener):
            if part is not None:
                part.close()
        self.engine.dispose()


def one_by_one(connection: Connection, query: Select[Any]) -> Iterator[Any]:
    """Return the rows of a query with a few of them in memory, however large they are."""
    return iter(connection.execute(query, execution_options={"yield_per": _FEW_ROWS}))


def new_id(result: CursorResult[Any]) -> int:
    """Return the id of the row that an INSERT has made."""
    (identifier,) = result.inserted_primary_key or (None,)
    if not isinstance(identifier, int):
        raise TypeError("the table has no integer key")
    return identifier


def insert_new(connection: Connection, table: Table, rows: Iterable[dict[str, Any]]) -> None:
    """Insert rows whose key is not there yet; the others stay as they are."""
    connection.execute(_insert_new(connection.dialect.name, table), list(rows))


@cache
def _insert_new(dialect: str, table: Table) -> Insert:
    found: Insert = _insert(dialect, table).on_conflict_do_nothing()
    return found


def put_row(
    connection: Connection, table: Table, row: dict[str, Any], changed: Iterable[str]
) -> None:
    """Insert a row; where its key is there already, change these columns."""
    connection.execute(_put_row(connection.dialect.name, table, tuple(changed)), row)


@cache
def _put_row(dialect: str, table: Table, changed: tuple[str, ...]) -> Insert:
    statement = _insert(dialect, table)
    found: Insert = statement.on_conflict_do_update(
        index_elements=list(table.primary_key),
        set_={name: statement.excluded[name] for name in changed},
    )
    return found


def _insert(dialect: str, table: Table) -> Any:
    """Begin an insert of the database's own kind; the other kind's modules would take 2 MB."""
    return import_module(f"sqlalchemy.dialects.{dialect}").insert(table)


def to_json(value: Any) -> str:
    """Write compact JSON; NaN and infinity raise ValueError."""
    return _encode(value)


_encode: Final[Callable[[Any], str]] = json.JSONEncoder(
    ensure_ascii=False, allow_nan=False, separators=(",", ":")
).encode
