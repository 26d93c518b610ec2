"""Who did what: every write by a person or the cloud, in the transaction that makes it.

A trail is set for the time of a request (or of a command at the shell). It is the witness of every
writing transaction of its thread: when the change is made, the trail writes its rows and the
transaction commits both, or neither. So no service can forget it; a service only says which thing
it has made (`about`), where the address of the request does not tell.
"""

import getpass
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, NamedTuple

from sqlalchemy import Connection

from edge_server.services.context import show_time
from edge_server.services.errors import SpentError
from edge_server.store import audit, tokens
from edge_server.store.audit import Entry, Row
from edge_server.store.database import WITNESS, Database

DONE: Final = "done"
PAGE: Final = 500
PROGRAM: Final = "system"
"""Role of what the program does by itself."""
SHELL: Final = "shell"
"""Role of who works at the machine's command line, which no key guards."""


class Actor(NamedTuple):
    """Who acts, with which key, from where, in which request."""

    who: str
    role: str
    key_prefix: str = ""
    address: str = ""
    request_id: str = ""


class Token(NamedTuple):
    """A signature of the cloud that this write uses up."""

    jti: str
    expires_at: float


class Trail:
    """What one request leaves in the log; also its transactions' witness."""

    def __init__(self, actor: Actor, action: str, subject: str, clock: Callable[[], float]) -> None:
        self.actor = actor
        self.action = action
        self.token: Token | None = None
        self.is_told = False
        self._subject = subject
        self._clock = clock
        self._made: list[str] = []
        self._changes_nothing = False
        self._has_spent = False

    @contextmanager
    def __call__(self, connection: Connection) -> Iterator[None]:
        """Stand by a transaction and write what it did as its last act; raises SpentError."""
        self._made.clear()
        self._changes_nothing = False
        yield
        if self._changes_nothing:
            return
        self._spend(connection)
        for subject in self._made or [self._subject]:
            audit.append(connection, self._entry(subject, DONE))
        self.is_told = True

    def refused(self, database: Database, result: str, *, is_audited: bool) -> None:
        """Tell of a write that was refused, in a transaction of its own.

        Its signature is used up like that of a write that was done: an order that was refused must
        not be carried out later, when somebody repeats it.
        """
        with database.write() as connection:
            self._changes_nothing = True  # As its own witness
            if self.token is not None:
                tokens.spend(connection, self.token.jti, self.token.expires_at)
            if is_audited:
                audit.append(connection, self._entry(self._subject, result))

    def about(self, subject: str) -> None:
        """Name a thing that the present transaction makes or changes."""
        self._made.append(subject)

    def made(self, identifier: int) -> None:
        """Name what the present transaction makes by its id, unless it is named already."""
        if not self._made:
            self._made.append(f"{self._subject}/{identifier}")

    def nothing_new(self) -> None:
        """Say that the present transaction changes nothing: it repeats an answer."""
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
    """Give the trail of this thread's request, None where nobody is to be told of."""
    witness = WITNESS.get()
    return witness if isinstance(witness, Trail) else None


def about(subject: str) -> None:
    """Name a thing that the present transaction makes, such as `plans/5`."""
    if (trail := current()) is not None:
        trail.about(subject)


def made(identifier: int) -> None:
    """Name what the present transaction makes by its id, unless it is named already."""
    if (trail := current()) is not None:
        trail.made(identifier)


def nothing_new() -> None:
    """Say that the present transaction changes nothing."""
    if (trail := current()) is not None:
        trail.nothing_new()


@contextmanager
def on_trail(trail: Trail | None) -> Iterator[None]:
    """Follow a trail, or none, for a while."""
    token = WITNESS.set(trail)
    try:
        yield
    finally:
        WITNESS.reset(token)


def at_the_shell(action: str, subject: str, clock: Callable[[], float]) -> Trail:
    """Make the trail of a command at the machine itself."""
    return Trail(Actor(getpass.getuser(), SHELL), action, subject, clock)


class Verdict(NamedTuple):
    """What a look at the whole log has found."""

    rows: int
    fault: str | None  # What is wrong, and with which row; None: nothing
    row_id: int | None = None


def verify(database: Database) -> Verdict:
    """Check the whole chain; names the first row that is not as it was written."""
    with database.read() as connection:
        audit.freeze(connection)
        chain = audit.ends(connection)
        count, before, expected = 0, chain.first_hash, chain.first_id + 1
        for row in audit.rows(connection):
            if (fault := _fault(row, expected, before)) is not None:
                return Verdict(count, fault, min(row.id, expected))
            count, before, expected = count + 1, row.hash, row.id + 1
    if expected != chain.last_id + 1:
        return Verdict(count, f"row {expected} is missing, and all after it", expected)
    if before != chain.last_hash:
        return Verdict(count, f"row {chain.last_id} is not the one that was written", chain.last_id)
    return Verdict(count, None)


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


def exported(
    database: Database, after_id: int = 0, since_s: float = 0.0
) -> Iterator[dict[str, object]]:
    """Give the rows as they are exported, a page and a transaction at a time."""
    while True:
        with database.read() as connection:
            found = audit.page(connection, after_id=after_id, limit=PAGE, since_s=since_s)
        if not found:
            return
        yield from (show(row) for row in found)
        after_id = found[-1].id


def show(row: Row) -> dict[str, object]:
    """Give a row as it is exported; `at` [s] is what was hashed, `time` is for people."""
    return {
        "id": row.id,
        **row.entry._asdict(),
        "time": show_time(row.entry.at),
        "prev_hash": row.prev_hash.hex(),
        "hash": row.hash.hex(),
    }
