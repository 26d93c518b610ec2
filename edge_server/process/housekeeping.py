"""Periodic tasks: expiry, and deletion of old rows."""

import logging
import threading
import time
from typing import Final

from sqlalchemy.exc import SQLAlchemyError

from edge_server.services import broker_work, events, retention
from edge_server.services import idempotency as post_idempotency
from edge_server.services.context import Context
from edge_server.store.connection.locks import WORK
from edge_server.store.rows import idempotency, work

LOG = logging.getLogger(__name__)
EXPIRY_S: Final = 1.0
CLEANUP_EVERY: Final = 600
DAY_S: Final = 86_400.0


def run(context: Context, stopping: threading.Event) -> None:
    """Run until stopped; retries while the database is busy or full.

    The first run is immediate: it reserves room for the relay, which the disk may not have later.
    """
    turn = 0
    while not stopping.is_set():
        try:
            broker_work.expire_if_due(context)
            context.space.maintain(time.monotonic())
            if turn % CLEANUP_EVERY == 0:
                clean_up(context)
                context.space.drop_aged(time.monotonic())
                if context.space.trusts_clock(time.monotonic()):
                    retention.delete_old(context)
        except (SQLAlchemyError, OSError) as error:  # The database, or the disk under the ballast
            LOG.warning("housekeeping has to wait: %s", error)
        turn += 1
        stopping.wait(EXPIRY_S)


def clean_up(context: Context) -> None:
    """Delete expired idempotency keys, requests, events and withdrawn work."""
    now = context.clock()
    with context.database.write(WORK) as connection:
        idempotency.delete_before(connection, now - post_idempotency.KEPT_S)
        broker_work.delete_old(connection, now)
        old = now - context.config.retain_plans_days * DAY_S
        events.delete_before(connection, old)
        work.delete_withdrawn(connection, old)
