"""The largest ids that were ever acknowledged or handed out, kept apart from the database.

A database that was deleted, or whose log was cut, does not know what it has lost: it looks like one
that is new, or a little older. The marks survive a kill; after a power cut they may be a little
behind, never ahead, since they are set after the commit. A mark that cannot be one is none.

A broker reports on work by its id, also on that of a database which is gone: of the next database
no work may have that id.
"""

import threading
from pathlib import Path
from typing import Final, NamedTuple

from edge_server.store import tally
from edge_server.store.tally import Tally

_RECORD: Final = "newest_record"
_WORK: Final = "newest_work"
_MOST: Final = 2**53
"""Up to here a double separates two integers."""


class Marks(NamedTuple):
    """The largest id of a record that was acknowledged, and of work that was handed out."""

    record: int = 0
    work: int = 0


class HighWater:
    """The marks of one state folder; safe to use from several threads."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._tally: Tally | None = None  # Not before there is something to note
        self._lock = threading.Lock()
        self._newest = dict(zip((_RECORD, _WORK), read(path), strict=True))

    def raise_to(self, record_id: int) -> None:
        """Note that a record has been committed; call before it is acknowledged."""
        self._raise(_RECORD, record_id)

    def raise_work_to(self, work_id: int) -> None:
        """Note which work there is; call before it is handed out."""
        self._raise(_WORK, work_id)

    def _raise(self, name: str, identifier: int) -> None:
        with self._lock:
            if identifier > self._newest[name]:
                self._newest[name] = identifier
                if self._tally is None:
                    self._tally = Tally(self._path)
                self._tally.put(name, value=float(identifier))


def path_of(database: Path) -> Path:
    """Give the file of the marks for a database."""
    return database.with_name("acknowledged.tally")


def read(path: Path) -> Marks:
    """Give the marks, 0 where there is none."""
    found = tally.read(path)
    record, work = (found.get(name, {}).get((), 0.0) for name in (_RECORD, _WORK))
    return Marks(_id(record), _id(work))


def _id(value: float) -> int:
    """Give a mark as an id; a file that is damaged may hold anything, NaN too."""
    return int(value) if 0 <= value < _MOST else 0
