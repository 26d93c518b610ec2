"""The identity of work: an acknowledgement is that of the work which was handed out.

The number of work alone starts again with a new database: a broker that has kept an answer for
days would end an order that it has never received. Therefore work is handed out with an identity,
which the broker repeats. A mission has that of its plan, an event one of its content and time.
"""

import hashlib
from typing import Final

from sqlalchemy import Connection

from edge_server.services.context import Context
from edge_server.services.errors import ConflictError
from edge_server.store.connection.database import to_json
from edge_server.store.rows import events, work
from edge_server.store.rows.work import Work

LENGTH: Final = 64
"""Of the identity of any work, at most."""
_EVENT_LENGTH: Final = 32
"""Of an event's, in hexadecimal digits."""


def identity_of(connection: Connection, item: Work) -> str | None:
    """Return the identity of a piece of work; None for a request, whose answer orders nothing.

    That of an event does not change when its age is corrected.
    """
    if item.kind != work.EVENT:
        return item.plan_id
    received_at = events.received_at(connection, item.id)
    if received_at is None:
        return None
    text = f"{received_at!r} {to_json(item.body or {})}"
    return hashlib.sha256(text.encode()).hexdigest()[:_EVENT_LENGTH]


def check(
    context: Context, connection: Connection, item: Work, repeated: str | None, *, ends: bool
) -> None:
    """Check that an acknowledgement is of this work; `ends` if it says that the work is done.

    An older broker repeats no identity. Its answer to an event is valid if the event was handed
    out. A shared database does not show that; there such an answer cannot end a queued event.

    Raises:
        ConflictError: if it is of other work of the same number.
    """
    if repeated is not None:
        if repeated != identity_of(connection, item):
            raise ConflictError(
                f"work {item.id} is other work than the acknowledged one, which had its number "
                "in a database that was replaced"
            )
    elif item.kind == work.EVENT and item.state == work.QUEUED:
        was_published = context.was_published(item.id)
        if was_published is False or (was_published is None and ends):
            raise ConflictError(
                f"work {item.id} has not been handed out: its acknowledgement needs the identity "
                "that GET /broker/commands gives"
            )
