"""Counts of connections, for metrics; the loop writes them, other threads read them."""

import threading
from collections import Counter


class ConnectionCounts:
    """Open connections, and connections closed before their request was served, by reason."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._closed: Counter[str] = Counter()
        self.open = 0

    def note_closed(self, reason: str) -> None:
        """Count a connection that was closed before its request was served."""
        with self._lock:
            self._closed[reason] += 1

    def closed(self) -> dict[str, int]:
        """Give the number of closed ones, by reason."""
        with self._lock:
            return dict(self._closed)


COUNTS = ConnectionCounts()
"""The counts of this process."""
