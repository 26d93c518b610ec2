"""Reads the farm 2.5 times a second while somebody watches, and publishes what has changed.

It compares states instead of being called by each writer: a change counts whoever made it, also
another edge server on the same database, and no write becomes slower or can fail because of it.
"""

import json
import logging
import threading
import time
from collections.abc import Callable
from typing import Final

from sqlalchemy.exc import SQLAlchemyError

from edge_server.live.changes import Changes
from edge_server.live.farm import NOTHING, Farm, differences, snapshot

LOG = logging.getLogger(__name__)
PERIOD_S: Final = 0.4
"""So that a position that is updated twice a second or more often is shown so."""
LINGER_S: Final = 30.0
"""It continues so long after the last reader, which may reconnect and continue."""


class Watcher:
    """One thread, alive while there are readers; every reader counts itself with `note_reader`."""

    def __init__(self, read: Callable[[], Farm], changes: Changes) -> None:
        """Begin asleep."""
        self._read = read
        self._changes = changes
        self._lock = threading.Lock()
        self._wanted_until = float("-inf")
        self._thread: threading.Thread | None = None
        self._is_first_read = threading.Event()
        self._farm = NOTHING
        self._encoded: tuple[Farm, str] = NOTHING, ""
        self.wake: Callable[[], None] = lambda: None
        """Called after changes were published."""

    def note_reader(self) -> None:
        """Note that somebody watches now; starts the thread if it sleeps."""
        with self._lock:
            self._wanted_until = time.monotonic() + LINGER_S
            if self._thread is None:
                self._is_first_read.clear()
                self._thread = threading.Thread(target=self._run, name="live", daemon=True)
                self._thread.start()

    @property
    def is_watched(self) -> bool:
        """Whether somebody watches, or did a moment ago."""
        return self._thread is not None

    def wait_for_first(self, timeout_s: float) -> bool:
        """Wait until the state is known; false if it is not within the time."""
        return self._is_first_read.wait(timeout_s)

    def look(self) -> None:
        """Read once and publish what has changed; the database's failures pass."""
        try:
            farm = self._read()
        except SQLAlchemyError as error:
            LOG.warning("the live stream cannot read the database: %s", error)
            return
        before, self._farm = self._farm, farm
        if self._is_first_read.is_set():
            found = list(differences(before, farm))
            if found:
                self._changes.add(found)
                self.wake()
        elif before is not NOTHING:
            # It slept: what changed, and what has left the latest meanwhile, is not known
            self._changes.forget()
            self.wake()
        self._is_first_read.set()

    def state(self, vehicle_ids: frozenset[int] | None) -> str:
        """Give the complete state as JSON, of these vehicles alone (None: of all).

        Readers who connect together share one text.
        """
        farm, (encoded_farm, encoded) = self._farm, self._encoded
        if vehicle_ids is None and encoded_farm is farm and encoded:
            return encoded
        text = json.dumps(snapshot(farm, vehicle_ids), ensure_ascii=False, separators=(",", ":"))
        if vehicle_ids is None:
            self._encoded = farm, text
        return text

    def _run(self) -> None:
        while True:
            try:
                self.look()
            except Exception:
                LOG.exception("the live stream cannot read the farm")  # The next time it may
            time.sleep(PERIOD_S)
            with self._lock:
                if time.monotonic() > self._wanted_until:
                    self._thread = None
                    return
