"""The largest id of a record that was ever acknowledged, kept apart from the database.

A database that was deleted, or whose log was cut, does not know what it has lost: it looks like one
that is new, or a little older. The mark survives a kill; after a power cut it may be a little
behind, never ahead, since it is set after the commit.
"""

import threading
from pathlib import Path
from typing import Final

from edge_server.store import tally
from edge_server.store.tally import Tally

_NAME: Final = "newest_record"


class HighWater:
    """The mark of one state folder; safe to use from several threads."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._tally: Tally | None = None  # Not before there is something to note
        self._lock = threading.Lock()
        self._newest = read(path)

    def raise_to(self, record_id: int) -> None:
        """Note that a record has been committed; call before it is acknowledged."""
        with self._lock:
            if record_id > self._newest:
                self._newest = record_id
                if self._tally is None:
                    self._tally = Tally(self._path)
                self._tally.put(_NAME, value=float(record_id))


def path_of(database: Path) -> Path:
    """Give the mark's file for a database."""
    return database.with_name("acknowledged.tally")


def read(path: Path) -> int:
    """Give the mark, 0 when there is none."""
    return int(tally.read(path).get(_NAME, {}).get((), 0.0))
