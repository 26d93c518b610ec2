"""Periodic tasks beside the requests: expiry, deletion of old rows, watch of the database file.

Reports and pictures have their own age limit, which declares what it drops (services.space).
"""

import logging
import sqlite3
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from sqlalchemy import Connection
from sqlalchemy.exc import SQLAlchemyError

from edge_server.services import post_idempotency
from edge_server.services.audit import DONE, PROGRAM
from edge_server.services.context import Context
from edge_server.services.fleet import broker_work
from edge_server.store.connection.locks import WORK
from edge_server.store.files import integrity
from edge_server.store.rows import (
    accounts,
    audit,
    idempotency,
    keys,
    plans,
    tokens,
    work_removal,
)
from edge_server.store.rows.audit import Entry

LOG = logging.getLogger(__name__)
EXPIRY_S: Final = 1.0
CLEANUP_EVERY: Final = 600
DAY_S: Final = 86_400.0
REQUESTS_KEPT_S: Final = 3600.0
"""Of requests for a state vector, from their expiry."""
FILE_CHECK_AFTER_S: Final = 2.0
"""Delay of the integrity check, which would slow down the first requests."""
FILE_LOOK_S: Final = 1.0


def run(context: Context, stopping: threading.Event) -> None:
    """Run until stopped; retries while the database is busy or full.

    The first run is immediate: it reserves room for the relay, which the disk may not have later.
    """
    turn = 0
    while not stopping.is_set():
        try:
            broker_work.expire_if_due(context)
            context.archive.maintain(
                trusts_clock=context.space.trusts_clock(time.monotonic()),
                lacking_bytes=context.space.lacking_bytes,
            )
            context.space.maintain(time.monotonic())
            if turn % CLEANUP_EVERY == 0:
                delete_requests(context)
                context.space.drop_aged(time.monotonic())
                if context.space.trusts_clock(time.monotonic()):
                    clean_up(context)
                    delete_old_records(context)
        except (SQLAlchemyError, OSError) as error:  # The database, or the disk under the ballast
            LOG.warning("housekeeping failed and is retried: %s", error)
        turn += 1
        stopping.wait(EXPIRY_S)


def delete_requests(context: Context) -> None:
    """Delete requests for a state vector that were answered, or have expired, an hour ago."""
    with context.database.write(WORK) as connection:
        work_removal.delete_requests(connection, context.clock() - REQUESTS_KEPT_S)


def clean_up(context: Context) -> None:
    """Delete expired idempotency keys, events and withdrawn work.

    The clock must be right: a record whose key is deleted too early is stored twice when it is
    repeated, and an event or withdrawn work is not recognised any more.
    """
    now = context.clock()
    with context.database.write(WORK) as connection:
        idempotency.delete_before(connection, now - post_idempotency.KEPT_S)
        old = now - context.config.retain_plans_days * DAY_S
        work_removal.delete_events(connection, old)
        work_removal.delete_withdrawn(connection, old)


def delete_old_records(context: Context) -> None:
    """Delete old plans, audit rows, ended keys and used signatures.

    The clock must be right: this cannot be undone.
    """
    now = context.clock()
    while _delete_plans(context, now):
        continue
    with context.database.write() as connection:
        tokens.delete_before(connection, now)
        accounts.delete_expired(connection, now)
        keys.delete_ended(connection, now - context.config.retain_audit_days * DAY_S)
        _cut_audit(context, connection, now)


def _delete_plans(context: Context, now: float) -> int:
    before = now - context.config.retain_plans_days * DAY_S
    with context.database.write() as connection:
        deleted = plans.delete_old(connection, before, now)
        if deleted:
            _record(connection, now, "retention.plans", f"{deleted} plans")
    return deleted


def _cut_audit(context: Context, connection: Connection, now: float) -> None:
    before = now - context.config.retain_audit_days * DAY_S
    deleted = audit.cut(connection, before)
    if deleted:
        first_id = audit.ends(connection).first_id
        _record(connection, now, "retention.audit", f"{deleted} rows, to row {first_id}")


def _record(connection: Connection, now: float, action: str, what: str) -> None:
    LOG.info("%s: %s", action, what)
    audit.append(connection, Entry(now, "edge server", PROGRAM, "", "", "", action, what, DONE))


def watch_file(context: Context, stopping: threading.Event, restart: Callable[[], None]) -> None:
    """Check the whole file once, then watch for its removal and for faults that others note.

    On a fault the server restarts, and the start quarantines the file. A file that was removed or
    replaced is a fault too: writes to the open one would be lost.
    """
    path = context.config.database_path
    if context.config.database_url is not None or not path.exists():
        return
    known = path.stat().st_ino
    if stopping.wait(FILE_CHECK_AFTER_S):
        return
    check_file(path)
    while _is_same_file(path, known) and integrity.noted_fault(path) is None:
        if stopping.wait(FILE_LOOK_S):
            return
    LOG.critical("the database %s cannot be used any more; the server restarts", path)
    restart()


def check_file(path: Path) -> None:
    """Check the integrity of the file; a fault is noted."""
    try:
        fault = integrity.fault_of(path)
    except sqlite3.Error as error:
        LOG.warning("the database could not be checked: %s", error)
        return
    if fault is not None:
        LOG.critical("the database is broken: %s", fault)
        integrity.note_fault(path, fault)


def _is_same_file(path: Path, inode: int) -> bool:
    try:
        return path.stat().st_ino == inode
    except FileNotFoundError:
        return False
