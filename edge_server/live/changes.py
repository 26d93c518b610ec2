"""The latest changes, numbered, so that a reader that was away continues after the last one it has.

A number belongs to one run of the server: `<run>-<number>`. A reader who has the number of another
run, or one that is no longer kept, begins anew with the complete state.
"""

import itertools
import json
import re
import threading
from collections import deque
from collections.abc import Iterable
from typing import Any, Final, NamedTuple

KEPT: Final = 2000
"""Changes; two minutes of 16 vehicles."""
_ID: Final = re.compile(r"([0-9a-f]{1,32})-([0-9]{1,18})")


class Change(NamedTuple):
    """One change, as every reader receives it."""

    number: int
    vehicle_id: int | None  # None: not about one vehicle
    event: bytes
    """The server-sent event."""


class Changes:
    """Written by the watcher, read by every stream; safe in any thread."""

    def __init__(self, run: str, kept: int = KEPT) -> None:
        """Begin without changes; `run` (hexadecimal) distinguishes this run of the server."""
        self._run = run
        self._lock = threading.Lock()
        self._kept: deque[Change] = deque(maxlen=kept)
        self.last = 0
        """Number of the latest change."""

    def add(self, changes: Iterable[tuple[str, int | None, Any]]) -> None:
        """Number and keep changes: name, vehicle, JSON object."""
        with self._lock:
            for name, vehicle_id, data in changes:
                text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
                event = self.encode(name, self.last + 1, text)
                self._kept.append(Change(self.last + 1, vehicle_id, event))
                self.last += 1

    def forget(self) -> None:
        """Keep no change: every reader with an earlier number begins anew."""
        with self._lock:
            self._kept.clear()
            self.last += 1

    def after(self, number: int) -> list[Change] | None:
        """The changes behind a number; None if some of them are no longer kept."""
        with self._lock:
            count = self.last - number
            if not 0 <= count <= len(self._kept):
                return None
            return list(itertools.islice(reversed(self._kept), count))[::-1]

    def encode(self, name: str, number: int, text: str) -> bytes:
        """Write a server-sent event; `text` is JSON."""
        return f"id: {self._run}-{number}\nevent: {name}\ndata: {text}\n\n".encode()

    def number_of(self, identifier: str) -> int | None:
        """Read an `id`; None for one of another run, or what is none."""
        found = _ID.fullmatch(identifier)
        return int(found[2]) if found and found[1] == self._run else None
