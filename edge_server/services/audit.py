"""Who did what: every write by a person or the cloud, in the transaction that makes it.

A trail is set for the duration of a request (or of a command at the shell). It is the hook of every
writing transaction of its thread: after the change the trail writes its rows, and the transaction
commits both or neither. So no service can omit it; a service only names the object that it has made
(`about`) if the address of the request does not name it.
"""

import getpass
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, NamedTuple

from sqlalchemy import Connection

from edge_server.services.context import show_time
from edge_server.services.errors import ChangedError, LastChange, SpentError
from edge_server.store.connection.database import TRANSACTION_HOOK, Database
from edge_server.store.rows import audit, tokens
from edge_server.store.rows.audit import Entry, Row

DONE: Final = "done"
PAGE: Final = 500
PROGRAM: Final = "system"
"""Role of what the program does without a request."""
SHELL: Final = "shell"
"""Role of a user at the machine's command line, which needs no key."""


class Actor(NamedTuple):
    """Who acts, with which key, from where, in which request."""

    who: str
    role: str
    key_prefix: str = ""
    address: str = ""
    request_id: str = ""


class Token(NamedTuple):
    """A signature of the cloud that this write uses."""

    jti: str
    expires_at: float


class Trail:
    """The audit rows of one request, and the hook of its transactions."""

    def __init__(self, actor: Actor, action: str, subject: str, clock: Callable[[], float]) -> None:
        self.actor = actor
        self.action = action
        self.token: Token | None = None
        self.is_recorded = False
        self._subject = subject
        self._clock = clock
        self._made: list[str] = []
        self._changes_nothing = False
        self._has_spent = False

    @contextmanager
    def __call__(self, connection: Connection) -> Iterator[None]:
        """Write the audit rows as the last step of a transaction; raises SpentError."""
        self._made.clear()
        self._changes_nothing = False
        yield
        if self._changes_nothing:
            return
        self._spend(connection)
        for subject in self._made or [self._subject]:
            audit.append(connection, self._entry(subject, DONE))
        self.is_recorded = True

    def record_refusal(self, database: Database, result: str, *, is_audited: bool) -> None:
        """Record a write that was refused, in a transaction of its own.

        Its signature is used too: a refused order must not be carried out when it is repeated
        later.
        """
        with database.write() as connection:
            self._changes_nothing = True  # This transaction has the trail as its hook too
            if self.token is not None:
                tokens.spend(connection, self.token.jti, self.token.expires_at)
            if is_audited:
                audit.append(connection, self._entry(self._subject, result))

    def about(self, subject: str) -> None:
        """Name an object that the present transaction makes or changes."""
        self._made.append(subject)

    def made(self, identifier: int) -> None:
        """Name the object that the present transaction makes by its id, unless it has a name."""
        if not self._made:
            self._made.append(f"{self._subject}/{identifier}")

    @property
    def repeats_answer(self) -> bool:
        """Whether the last transaction changed nothing: the request had been made before."""
        return self._changes_nothing

    def changes_nothing(self) -> None:
        """Note that the present transaction changes nothing: it repeats an answer."""
        self._changes_nothing = True

    def _spend(self, connection: Connection) -> None:
        token = self.token
        if token is None:
            return
        is_new = tokens.spend(connection, token.jti, token.expires_at)
        # A transaction may be tried again, and a request may need several
        if not is_new and not self._has_spent:
            raise SpentError("this signature has been used before (jti)")
        self._has_spent = True

    def _entry(self, subject: str, result: str) -> Entry:
        return Entry(self._clock(), *self.actor, self.action, subject, result)


def current() -> Trail | None:
    """Return the trail of this thread's request, None if it is not audited."""
    hook = TRANSACTION_HOOK.get()
    return hook if isinstance(hook, Trail) else None


def about(subject: str) -> None:
    """Name an object that the present transaction makes, such as `plans/5`."""
    if (trail := current()) is not None:
        trail.about(subject)


def made(identifier: int) -> None:
    """Name the object that the present transaction makes by its id, unless it has a name."""
    if (trail := current()) is not None:
        trail.made(identifier)


def changes_nothing() -> None:
    """Note that the present transaction changes nothing."""
    if (trail := current()) is not None:
        trail.changes_nothing()


@contextmanager
def naming_last_change(connection: Connection, *objects: str) -> Iterator[None]:
    """Say in a ChangedError of this block who changed the object last, by any of its names."""
    try:
        yield
    except ChangedError as error:
        found = audit.last_of(connection, objects, DONE)
        if found is not None:
            error.last = LastChange(found.who, show_time(found.at), found.action)
        raise


@contextmanager
def use_trail(trail: Trail | None) -> Iterator[None]:
    """Set the trail, or none, of this thread for the duration of a block."""
    token = TRANSACTION_HOOK.set(trail)
    try:
        yield
    finally:
        TRANSACTION_HOOK.reset(token)


def shell_trail(action: str, subject: str, clock: Callable[[], float]) -> Trail:
    """Return the trail of a command at the machine's command line."""
    return Trail(Actor(getpass.getuser(), SHELL), action, subject, clock)


class Verification(NamedTuple):
    """Result of checking the whole log."""

    rows: int
    fault: str | None  # What is wrong, and with which row; None: nothing
    row_id: int | None = None


def verify(database: Database) -> Verification:
    """Check the whole chain; names the first row that is not as it was written."""
    with database.read() as connection:
        audit.freeze(connection)
        chain = audit.ends(connection)
        count, before, expected = 0, chain.first_hash, chain.first_id + 1
        for row in audit.rows(connection):
            if (fault := _fault(row, expected, before)) is not None:
                return Verification(count, fault, min(row.id, expected))
            count, before, expected = count + 1, row.hash, row.id + 1
    if expected != chain.last_id + 1:
        return Verification(count, f"row {expected} is missing, and all after it", expected)
    if before != chain.last_hash:
        return Verification(
            count, f"row {chain.last_id} is not the one that was written", chain.last_id
        )
    return Verification(count, None)


def _fault(row: Row, expected_id: int, before: bytes) -> str | None:
    if row.id < expected_id:
        return f"row {row.id} was removed once, and is here again"
    if row.id > expected_id:
        return f"row {expected_id} is missing"
    if row.prev_hash != before:
        return f"row {row.id} does not follow the row before it"
    if row.hash != audit.hash_of(row.id, row.entry, row.prev_hash):
        return f"row {row.id} has been changed"
    return None


def export(
    database: Database, after_id: int = 0, since_s: float = 0.0
) -> Iterator[dict[str, object]]:
    """Return the rows as they are exported, a page and a transaction at a time."""
    while True:
        with database.read() as connection:
            found = audit.page(connection, after_id=after_id, limit=PAGE, since_s=since_s)
        if not found:
            return
        yield from (show(row) for row in found)
        after_id = found[-1].id


def show(row: Row) -> dict[str, object]:
    """Return a row as it is exported; `at` [s] is what was hashed, `time` is for people."""
    return {
        "id": row.id,
        **row.entry._asdict(),
        "time": show_time(row.entry.at),
        "prev_hash": row.prev_hash.hex(),
        "hash": row.hash.hex(),
    }
