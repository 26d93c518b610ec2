"""What the front has seen, for metrics and log; written by its loop, read by others."""

import threading
from collections import Counter


class FrontCounts:
    """Connections that are open now, and those that were closed unserved, by reason."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._closed: Counter[str] = Counter()
        self.open = 0

    def note_closed(self, reason: str) -> None:
        """Count a connection that was closed before its request was served."""
        with self._lock:
            self._closed[reason] += 1

    def closed(self) -> dict[str, int]:
        """How many were closed so far, by reason."""
        with self._lock:
            return dict(self._closed)


COUNTS = FrontCounts()
"""Those of this process."""
