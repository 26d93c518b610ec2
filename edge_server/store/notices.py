"""Wakes the other programs on a PostgreSQL database: NOTIFY in one, LISTEN in the others.

A notice is sent after the commit it tells of, in a transaction of its own that waits for no disk:
PostgreSQL lets transactions with a notice commit one at a time. A lost notice costs the time
until the other side looks by itself, never a record.
"""

import logging
import threading
import time
from collections.abc import Callable
from typing import Final, cast

import psycopg
from sqlalchemy import Engine, text
from sqlalchemy.exc import DBAPIError

from edge_server.store.database import Topic

LOG = logging.getLogger(__name__)

_CHANNEL: Final = "edge_server"
_SPACING_S: Final = 0.005
_LOOK_S: Final = 0.2
_RETRY_S: Final = 1.0
_NOTIFY: Final = text(
    "SELECT set_config('synchronous_commit', 'off', true), pg_notify(:channel, :topic)"
)


class Sender:
    """Sends notices from a thread of its own; those of the same moment go together."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._changed = threading.Condition()
        self._topics: set[str] = set()
        self._closed = False
        self._thread: threading.Thread | None = None

    def send(self, topic: str) -> None:
        """Have a topic told soon."""
        with self._changed:
            self._topics.add(topic)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, daemon=True)
                self._thread.start()
            self._changed.notify()

    def close(self) -> None:
        """Send what waits, then end."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        while topics := self._wait():
            try:
                with self._engine.begin() as connection:
                    for topic in sorted(topics):
                        connection.execute(_NOTIFY, {"channel": _CHANNEL, "topic": topic}).close()
            except DBAPIError as error:
                LOG.debug("a notice is lost: %s", error.orig)
            time.sleep(_SPACING_S)

    def _wait(self) -> set[str]:
        """Give what is to be told; nothing when it is time to end."""
        with self._changed:
            self._changed.wait_for(lambda: self._topics or self._closed)
            topics, self._topics = self._topics, set()
            return topics


class Listener:
    """Hears notices in a thread of its own, and connects again when the connection is lost."""

    def __init__(
        self, engine: Engine, on_notice: Callable[[str], None], at_end: Callable[[], None]
    ) -> None:
        self._engine = engine
        self._on_notice = on_notice
        self._at_end = at_end
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> "Listener":
        """Begin to listen."""
        self._thread.start()
        return self

    def close(self) -> None:
        """Hear no more."""
        self._stopping.set()
        self._thread.join()
        self._at_end()

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                self._listen()
            except (DBAPIError, psycopg.Error) as error:
                LOG.debug("notices are not heard: %s", error)
                self._stopping.wait(_RETRY_S)

    def _listen(self) -> None:
        with self._engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
            connection.detach()  # Its session listens, so nobody else shall use it
            connection.exec_driver_sql(f"LISTEN {_CHANNEL}").close()
            driver = cast("psycopg.Connection[object]", connection.connection.dbapi_connection)
            for topic in (Topic.CHANGED, Topic.WORK):  # Whatever was told before this moment
                self._on_notice(topic)
            while not self._stopping.is_set():
                for notice in driver.notifies(timeout=_LOOK_S):
                    self._on_notice(notice.payload)
