"""The brokers of this server: wakes their long polls, and stores when each last made a request.

A vehicle is served by one broker: the first that makes a request about it, until that one has made
none for `SERVED_S` (`edge_server/store/rows/vehicles.py`), or for `URGENT_SERVED_S` while an order
that stops the flight waits. A broker is known by its access key and its instance, so two brokers
with one key are two. Only the broker that serves a vehicle gets its work and may accept it; what
another one reports is stored all the same.

An operator may close the mission of a broker that has failed. Every request of a broker shows that
it runs: a report, an acknowledgement, or a poll for work. Each vehicle's time is stored at most
every 10 s, so that thousands of records a second cost nothing.
"""

import logging
import threading
from collections.abc import Callable, Collection, Iterable
from typing import Final

from sqlalchemy import Connection
from sqlalchemy.exc import DBAPIError

from edge_server.store.connection.database import Database
from edge_server.store.rows import vehicles
from edge_server.store.rows.work import Work

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


def note_contact(
    connection: Connection,
    broker: str,
    vehicle_ids: Collection[int],
    now: float,
    within_s: float = vehicles.SERVED_S,
) -> None:
    """Store a request of a broker about vehicles; log those that another broker serves."""
    for vehicle_id in vehicles.note_contact(connection, broker, vehicle_ids, now, within_s):
        LOG.error(
            "vehicle %d has two brokers: %s gets no work for it while the other one is connected",
            *(vehicle_id, broker),
        )


class BrokerContacts:
    """Stores when each broker last made a request about a vehicle; thread-safe."""

    def __init__(self, database: Database, clock: Callable[[], float]) -> None:
        self._database = database
        self._clock = clock
        self._lock = threading.Lock()
        self._stored: dict[tuple[str, int | None], float] = {}  # By broker and vehicle, or poll
        self._polls: dict[str, int] = {}  # How many each broker has begun
        self._withheld: dict[tuple[str, int], int] = {}  # First work, by broker and vehicle

    def note(self, broker: str, vehicle_ids: Collection[int]) -> None:
        """Note a request of a broker about vehicles."""
        now = self._clock()
        due = {one for one in vehicle_ids if self._is_due((broker, one), now)}
        if due:
            self._store(lambda rows: note_contact(rows, broker, due, now))

    def begin_poll(self, broker: str) -> int:
        """Note that a broker polls for work; returns the number of this poll."""
        with self._lock:
            number = self._polls.get(broker, 0) + 1
            self._polls[broker] = number
        self.note_poll(broker)
        return number

    def note_poll(self, broker: str) -> None:
        """Note that a broker polls for work, or still waits for it."""
        now = self._clock()
        if self._is_due((broker, None), now):
            self._store(lambda rows: vehicles.note_poll(rows, broker, now))

    def note_cut_off(self, broker: str, number: int) -> None:
        """Note that the connection of a poll was closed, unless the broker has polled again.

        It may have polled at another server of a shared database, which is not known here.
        """
        with self._lock:
            if self._polls.get(broker) != number or self._database.is_shared:
                return
            for key in [one for one in self._stored if one[0] == broker]:
                del self._stored[key]  # Its next request is stored at once
        now = self._clock()
        self._store(lambda rows: vehicles.note_cut_off(rows, broker, now))

    def withhold(self, broker: str, items: Iterable[Work]) -> None:
        """Note work of vehicles that another broker serves; this one's cursor passes it."""
        with self._lock:
            for item in items:
                key = (broker, item.vehicle_id or 0)
                self._withheld[key] = min(item.id, self._withheld.get(key, item.id))

    def first_released(self, broker: str, cursor: int, others: Collection[int]) -> int:
        """Move a cursor back to work that was withheld, of vehicles not among these `others`."""
        with self._lock:
            released = [key for key in self._withheld if key[0] == broker and key[1] not in others]
            return min([cursor, *(self._withheld.pop(key) - 1 for key in released)])

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
