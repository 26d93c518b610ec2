"""A POST that is repeated under its idempotency key has its effect once."""

import hashlib
import json
from collections.abc import Callable
from typing import TypeVar

from sqlalchemy import Connection

from edge_server.services import audit
from edge_server.services.context import Caller
from edge_server.services.errors import KeyReusedError
from edge_server.store import idempotency
from edge_server.store.database import to_json
from edge_server.store.idempotency import Answered

_Answer = TypeVar("_Answer")
KEPT_S = 72 * 3600.0


def hash_body(body: dict[str, object]) -> bytes:
    """Hash a canonical body; spacing and spelling of the original do not count."""
    return hashlib.sha256(to_json(body).encode()).digest()


def earlier(
    connection: Connection, caller: Caller, route: str, body_sha256: bytes
) -> Answered | None:
    """Find the answer to the same POST; None when this is the first.

    Raises:
        KeyReusedError: if the key was used for something else.
    """
    if caller.idempotency_key is None:
        return None
    found = idempotency.find(connection, caller.idempotency_key, caller.owner)
    if found is not None and (found.route, found.body_sha256) != (route, body_sha256):
        raise reused()
    if found is not None:
        audit.nothing_new()
    return found


def reused() -> KeyReusedError:
    """Make the refusal of a key that was used for something else."""
    return KeyReusedError("this Idempotency-Key was used for another request")


def remember(connection: Connection, caller: Caller, answered: Answered) -> None:
    """Keep the answer, when the caller gave a key; the audit log names what was made."""
    audit.made(answered.object_id)
    if caller.idempotency_key is not None:
        idempotency.remember(connection, caller.idempotency_key, caller.owner, answered)


def repeated(answered: Answered, make_again: Callable[[], _Answer]) -> _Answer:
    """Give an answer as it was given first, whatever has become since of what was made then.

    One of an older version was not kept and is made again.
    """
    if answered.answer is None:
        return make_again()
    first: _Answer = json.loads(answered.answer)
    return first
