"""Deletes what has been kept for its time: plans, the audit log, ended keys, used signatures.

Reports and pictures have their own age limit, which declares what it drops (services.space).
"""

import logging
from typing import Final

from sqlalchemy import Connection

from edge_server.services.audit import DONE, PROGRAM
from edge_server.services.context import Context
from edge_server.store.rows import audit, keys, plans, tokens
from edge_server.store.rows.audit import Entry

LOG = logging.getLogger(__name__)
_DAY_S: Final = 86_400.0


def delete_old(context: Context) -> None:
    """Delete what is too old by the clock, which must be right: this cannot be undone."""
    now = context.clock()
    while _delete_plans(context, now):
        continue
    with context.database.write() as connection:
        tokens.delete_before(connection, now)
        keys.delete_ended(connection, now - context.config.retain_audit_days * _DAY_S)
        _cut_audit(context, connection, now)


def _delete_plans(context: Context, now: float) -> int:
    before = now - context.config.retain_plans_days * _DAY_S
    with context.database.write() as connection:
        gone = plans.delete_old(connection, before, now)
        if gone:
            _record(connection, now, "retention.plans", f"{gone} plans")
    return gone


def _cut_audit(context: Context, connection: Connection, now: float) -> None:
    before = now - context.config.retain_audit_days * _DAY_S
    gone = audit.cut(connection, before)
    if gone:
        first_id = audit.ends(connection).first_id
        _record(connection, now, "retention.audit", f"{gone} rows, to row {first_id}")


def _record(connection: Connection, now: float, action: str, what: str) -> None:
    LOG.info("%s: %s", action, what)
    audit.append(connection, Entry(now, "edge server", PROGRAM, "", "", "", action, what, DONE))
