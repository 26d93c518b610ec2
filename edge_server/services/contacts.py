"""When each broker last made a request about a vehicle.

An operator may close the mission of a broker that does not come back. Every request of a broker
shows that it lives: a report, an acknowledgement, or a poll for work. Each vehicle's time is stored
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


class BrokerContacts:
    """Stores the contacts of one edge server; safe to use from several threads."""

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
        """Store a contact; the request goes on without it if the database is full or busy."""
        try:
            self._database.write_together(write)
        except DBAPIError as error:
            LOG.debug("a contact of a broker is not stored: %s", error.orig)
