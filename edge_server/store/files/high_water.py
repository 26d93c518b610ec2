"""The largest ids that were ever acknowledged or published, stored outside the database.

A database that was deleted, or whose log was cut, does not show what it has lost: it looks new, or
a little older. The marks survive a kill; after a power cut they may be a little behind, never
ahead, since they are set after the commit. An impossible mark is ignored.

A broker reports on work by its id, also on work of a database that no longer exists: no work of
the next database may have that id.
"""

import threading
from pathlib import Path
from typing import Final, NamedTuple

from edge_server.store.files import tally
from edge_server.store.files.tally import Tally

_RECORD: Final = "newest_record"
_WORK: Final = "newest_work"
_MOST: Final = 2**53
"""Up to here a double separates two integers."""


class Marks(NamedTuple):
    """The largest id of a record that was acknowledged, and of work that was published."""

    record: int = 0
    work: int = 0


class HighWater:
    """The marks of one state folder; safe to use from several threads."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._tally: Tally | None = None  # Opened at the first mark
        self._lock = threading.Lock()
        self._newest = dict(zip((_RECORD, _WORK), read(path), strict=True))

    def raise_to(self, record_id: int) -> None:
        """Note that a record has been committed; call before it is acknowledged."""
        self._raise(_RECORD, record_id)

    def raise_work_to(self, work_id: int) -> None:
        """Note which work there is; call before it is published."""
        self._raise(_WORK, work_id)

    @property
    def newest_work(self) -> int:
        """The largest id of work that was published."""
        return self._newest[_WORK]

    def close(self) -> None:
        """Close the file; the next mark opens it again."""
        with self._lock:
            if self._tally is not None:
                self._tally.close()
                self._tally = None

    def _raise(self, name: str, identifier: int) -> None:
        with self._lock:
            if identifier > self._newest[name]:
                self._newest[name] = identifier
                if self._tally is None:
                    self._tally = Tally(self._path)
                self._tally.put(name, value=float(identifier))


def path_of(database: Path) -> Path:
    """Return the file of the marks of a database."""
    return database.with_name("acknowledged.tally")


def read(path: Path) -> Marks:
    """Return the marks, 0 if there is none."""
    found = tally.read(path)
    record, work = (found.get(name, {}).get((), 0.0) for name in (_RECORD, _WORK))
    return Marks(_id(record), _id(work))


def _id(value: float) -> int:
    """Return a mark as an id; a damaged file may hold anything, NaN too."""
    return int(value) if 0 <= value < _MOST else 0
