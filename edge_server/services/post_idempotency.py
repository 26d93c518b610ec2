"""A POST that is repeated under its idempotency key has its effect once."""

import hashlib
import json
from collections.abc import Callable
from typing import TypeVar

from sqlalchemy import Connection

from edge_server.services import audit
from edge_server.services.context import Caller
from edge_server.services.errors import KeyReusedError
from edge_server.store.connection.database import to_json
from edge_server.store.rows import idempotency
from edge_server.store.rows.idempotency import Answered

_Answer = TypeVar("_Answer")
KEPT_S = 72 * 3600.0


def hash_body(body: dict[str, object]) -> bytes:
    """Hash a canonical body, which does not depend on spacing and spelling of the original."""
    return hashlib.sha256(to_json(body).encode()).digest()


def find_answer(
    connection: Connection, caller: Caller, route: str, body_sha256: bytes
) -> Answered | None:
    """Return the answer to the same POST; None if this is the first.

    Raises:
        KeyReusedError: if the key was used for something else.
    """
    if caller.idempotency_key is None:
        return None
    found = idempotency.find(connection, caller.idempotency_key, caller.owner)
    if found is not None and (found.route, found.body_sha256) != (route, body_sha256):
        raise key_reused()
    if found is not None:
        audit.changes_nothing()
    return found


def key_reused() -> KeyReusedError:
    """Return the error for a key that was used for another request."""
    return KeyReusedError("this Idempotency-Key was used for another request")


def store_answer(connection: Connection, caller: Caller, answered: Answered) -> None:
    """Store the answer if the request has a key; the audit log names the object."""
    audit.made(answered.object_id)
    if caller.idempotency_key is not None:
        idempotency.add(connection, caller.idempotency_key, caller.owner, answered)


def first_answer(answered: Answered, make_again: Callable[[], _Answer]) -> _Answer:
    """Return the first answer, however the object has changed since.

    An older version did not store the answer; then it is made again.
    """
    if answered.answer is None:
        return make_again()
    first: _Answer = json.loads(answered.answer)
    return first
