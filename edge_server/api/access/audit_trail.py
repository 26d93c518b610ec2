"""Audit trail of a request: begins when its caller is identified, ends with the request.

The audit log has writes of people and of the cloud, not of the broker, and no reads. It also has
writes that were refused because of the caller or of the state of a resource.
"""

import logging
from typing import Final

from flask import Flask, Response, g, request
from sqlalchemy.exc import SQLAlchemyError

from edge_server.api.access.scopes import SAFE_METHODS
from edge_server.services.audit import Actor, Trail
from edge_server.services.context import Context
from edge_server.store.connection.database import TRANSACTION_HOOK
from edge_server.store.rows.keys import Role, StoredKey

LOG = logging.getLogger(__name__)
REFUSALS: Final = frozenset({401, 403, 409, 412})
PASSING: Final = frozenset({408, 425, 429})
"""Temporary refusals: the client may send the same request again."""


def install(app: Flask, context: Context) -> None:
    """Install the audit trail in an app; call it before the first request."""

    def end(response: Response) -> Response:
        _record_refusal(context, response.status_code)
        return response

    app.after_request(end)
    app.teardown_request(_clear)


def begin(context: Context, key: StoredKey) -> None:
    """Begin the trail of a request with this key."""
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
    TRANSACTION_HOOK.set(g.trail)


def current() -> Trail | None:
    """Give the trail of this request; None if it has none."""
    found: Trail | None = g.get("trail")
    return found


def _subject() -> str:
    """Resource that the path names, such as `plans/5`."""
    named = [str(value) for value in (request.view_args or {}).values()]
    return "/".join([request.blueprint or "", *named])


def _record_refusal(context: Context, status: int) -> None:
    trail = current()
    if trail is None or trail.is_recorded:
        return
    uses_signature = trail.token is not None and 400 <= status < 500 and status not in PASSING
    if status not in REFUSALS and not uses_signature:
        return
    try:
        trail.record_refusal(context.database, str(status), is_audited=status in REFUSALS)
    except SQLAlchemyError as error:
        LOG.error("a refusal could not be written to the audit log: %s", error)  # noqa: TRY400  # the sentence is enough


def _clear(_error: BaseException | None) -> None:
    TRANSACTION_HOOK.set(None)
