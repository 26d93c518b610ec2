"""The brokers of this server: wakes their long polls, and stores when each last made a request.

An operator may close the mission of a broker that has failed. Every request of a broker
shows that it runs: a report, an acknowledgement, or a poll for work. Each vehicle's time is stored
at most every 10 s, so that thousands of records a second cost nothing.
"""

import logging
import threading
from collections.abc import Callable, Collection
from typing import Final

from sqlalchemy import Connection
from sqlalchemy.exc import DBAPIError

from edge_server.store.connection.database import Database
from edge_server.store.rows import vehicles

LOG = logging.getLogger(__name__)
INTERVAL_S: Final = 10.0


class WorkSignal:
    """Wakes every waiting thread; a signal between reading `count` and `wait` is not lost.

    `notify_others` wakes the long polls at other servers on the same database.
    """

    def __init__(self, notify_others: Callable[[], None] = lambda: None) -> None:
        self._notify_others = notify_others
        self._changed = threading.Condition()
        self._count = 0
        self._closed = False

    @property
    def count(self) -> int:
        """How often it was signalled; read it before looking for work."""
        return self._count

    @property
    def closed(self) -> bool:
        """Whether the server stops, so that no thread should wait any more."""
        return self._closed

    def notify(self) -> None:
        """Wake every waiting thread, here and at the other servers."""
        self.notify_here()
        self._notify_others()

    def notify_here(self) -> None:
        """Wake every thread that waits at this server."""
        with self._changed:
            self._count += 1
            self._changed.notify_all()

    def close(self) -> None:
        """Wake every thread for the last time: the server stops."""
        self._closed = True
        self.notify_here()

    def wait(self, seen: int, timeout_s: float) -> None:
        """Wait until `count` differs from `seen`, or for the timeout."""
        with self._changed:
            self._changed.wait_for(lambda: self._count != seen or self._closed, timeout_s)


class BrokerContacts:
    """Stores when each broker last made a request about a vehicle; thread-safe."""

    def __init__(self, database: Database, clock: Callable[[], float]) -> None:
        self._database = database
        self._clock = clock
        self._lock = threading.Lock()
        self._stored: dict[tuple[str, int | None], float] = {}  # By broker and vehicle, or poll

    def note(self, broker: str, vehicle_ids: Collection[int]) -> None:
        """Note a request of a broker about vehicles; `broker` is the owner of its access key."""
        now = self._clock()
        due = {one for one in vehicle_ids if self._is_due((broker, one), now)}
        if due:
            self._store(lambda rows: vehicles.note_contact(rows, broker, due, now))

    def note_poll(self, broker: str) -> None:
        """Note that a broker polls for work."""
        now = self._clock()
        if self._is_due((broker, None), now):
            self._store(lambda rows: vehicles.note_poll(rows, broker, now))

    def _is_due(self, key: tuple[str, int | None], now: float) -> bool:
        with self._lock:
            stored = self._stored.get(key)
            is_due = stored is None or abs(now - stored) >= INTERVAL_S
            if is_due:
                self._stored[key] = now
            return is_due

    def _store(self, write: Callable[[Connection], None]) -> None:
        """Store a contact; the request continues without it if the database is full or busy."""
        try:
            self._database.write_together(write)
        except DBAPIError as error:
            LOG.debug("a contact of a broker is not stored: %s", error.orig)
