"""The trail of a request into the audit log: begun when its caller is known, ended with it.

Only what changes something is told of, and only where a person or the cloud asks for it; a write
that was refused for who asks, or for the state of things, is told of too.
"""

import logging
from typing import Final

from apiflask import APIFlask
from flask import Response, g, request
from sqlalchemy.exc import SQLAlchemyError

from edge_server.api.scopes import SAFE_METHODS
from edge_server.services.audit import Actor, Trail
from edge_server.services.context import Context
from edge_server.store.database import WITNESS
from edge_server.store.keys import Role, StoredKey

LOG = logging.getLogger(__name__)
REFUSALS: Final = frozenset({401, 403, 409, 412})
PASSING: Final = frozenset({408, 425, 429})
"""Refusals of the moment: the same request may be sent again."""


def install(app: APIFlask, context: Context) -> None:
    """Let every request leave its trail; call before the routes are used."""

    def end(response: Response) -> Response:
        _tell_refusal(context, response.status_code)
        return response

    app.after_request(end)
    app.teardown_request(_leave)


def begin(context: Context, key: StoredKey) -> None:
    """Follow a request of this key from here on."""
    if request.method in SAFE_METHODS or key.role == Role.BROKER or request.endpoint is None:
        return
    actor = Actor(
        who=key.name,
        role=key.role,
        key_prefix=key.prefix,
        address=request.remote_addr or "",
        request_id=g.get("request_id", ""),
    )
    g.trail = Trail(actor, request.endpoint, _subject(), context.clock)
    WITNESS.set(g.trail)


def current() -> Trail | None:
    """Give the trail of this request; None where there is nothing to be told of."""
    found: Trail | None = g.get("trail")
    return found


def _subject() -> str:
    """The thing that the address names, such as `plans/5`."""
    named = [str(value) for value in (request.view_args or {}).values()]
    return "/".join([request.blueprint or "", *named])


def _tell_refusal(context: Context, status: int) -> None:
    trail = current()
    if trail is None or trail.is_told:
        return
    uses_signature = trail.token is not None and 400 <= status < 500 and status not in PASSING
    if status not in REFUSALS and not uses_signature:
        return
    try:
        trail.refused(context.database, str(status), is_audited=status in REFUSALS)
    except SQLAlchemyError as error:
        LOG.error("a refusal could not be written to the audit log: %s", error)  # noqa: TRY400  # the sentence is enough


def _leave(_error: BaseException | None) -> None:
    WITNESS.set(None)
