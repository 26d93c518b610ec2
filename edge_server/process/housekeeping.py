"""What must happen though nobody asks: expiry, and forgetting what is too old."""

import logging
import threading
import time
from typing import Final

from sqlalchemy.exc import SQLAlchemyError

from edge_server.services import broker_work, events, once, retention
from edge_server.services.context import Context
from edge_server.store import idempotency, work
from edge_server.store.locks import WORK

LOG = logging.getLogger(__name__)
EXPIRY_S: Final = 1.0
FORGETTING_EVERY: Final = 600
DAY_S: Final = 86_400.0


def run(context: Context, stopping: threading.Event) -> None:
    """Keep house until told to stop; a busy or full database is tried again.

    The first turn is at once: a disk may be full a moment after the start, and the room that the
    relay needs then has to be held before.
    """
    turn = 0
    while not stopping.is_set():
        try:
            broker_work.expire_if_due(context)
            context.space.keep(time.monotonic())
            if turn % FORGETTING_EVERY == 0:
                forget(context)
                context.space.keep_age(time.monotonic())
                if context.space.trusts_clock(time.monotonic()):
                    retention.keep(context)
        except (SQLAlchemyError, OSError) as error:  # The database, or the disk under the ballast
            LOG.warning("housekeeping has to wait: %s", error)
        turn += 1
        stopping.wait(EXPIRY_S)


def forget(context: Context) -> None:
    """Drop idempotency keys and requests that nobody will ask for again."""
    now = context.clock()
    with context.database.write(WORK) as connection:
        idempotency.forget_before(connection, now - once.KEPT_S)
        broker_work.forget_old(connection, now)
        old = now - context.config.retain_plans_days * DAY_S
        events.forget_before(connection, old)
        work.forget_withdrawn(connection, old)
