"""Watches the database file while the server runs: integrity and presence."""

import logging
import sqlite3
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Final

from edge_server.services.context import Context
from edge_server.store.files import integrity

LOG = logging.getLogger(__name__)
CHECK_AFTER_S: Final = 2.0
"""Delay of the integrity check, which would slow down the first requests."""
LOOK_S: Final = 1.0


def run(context: Context, stopping: threading.Event, restart: Callable[[], None]) -> None:
    """Check the whole file once, then watch for its removal and for faults that others note.

    On a fault the server restarts, and the start quarantines the file. A file that was removed or
    replaced is a fault too: writes to the open one would be lost.
    """
    path = context.config.database_path
    if context.config.database_url is not None or not path.exists():
        return
    known = path.stat().st_ino
    if stopping.wait(CHECK_AFTER_S):
        return
    check(path)
    while _is(path, known) and integrity.noted_fault(path) is None:
        if stopping.wait(LOOK_S):
            return
    LOG.critical("the database %s cannot be used any more; the server restarts", path)
    restart()


def check(path: Path) -> None:
    """Check the integrity of the file; a fault is noted."""
    try:
        fault = integrity.fault_of(path)
    except sqlite3.Error as error:
        LOG.warning("the database could not be checked: %s", error)
        return
    if fault is not None:
        LOG.critical("the database is broken: %s", fault)
        integrity.note_fault(path, fault)


def _is(path: Path, inode: int) -> bool:
    try:
        return path.stat().st_ino == inode
    except FileNotFoundError:
        return False
