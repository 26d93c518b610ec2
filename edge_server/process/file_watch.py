"""Looks after the database's file while the server runs: is it whole, is it there."""

import logging
import sqlite3
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Final

from edge_server.services.context import Context
from edge_server.store import integrity

LOG = logging.getLogger(__name__)
CHECK_AFTER_S: Final = 2.0
"""The first requests have the disk to themselves."""
LOOK_S: Final = 1.0


def run(context: Context, stopping: threading.Event, start_again: Callable[[], None]) -> None:
    """Check the whole file once, then see to it that it is there and that nobody finds a fault.

    On a fault the server ends; the next start sets the file aside. A file that was taken away or
    replaced holds nothing of what we would still write into it, so that is a fault too.
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
    LOG.critical("the database %s cannot be used any more; the server starts anew", path)
    start_again()


def check(path: Path) -> None:
    """Look at all of the file; a fault is noted."""
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
