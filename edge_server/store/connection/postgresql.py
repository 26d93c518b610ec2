"""What only PostgreSQL needs: notices between programs, and text without NUL; loads psycopg.

NOTIFY in one program wakes the others, which LISTEN. A notice is sent after the commit that it is
about, in a transaction of its own that waits for no disk: PostgreSQL commits transactions with a
notice one at a time. A lost notice delays the other program until it looks by itself; no record is
lost.

PostgreSQL's text cannot hold a NUL. A vehicle's message with a NUL is stored with U+FFFD in its
place; a NUL in an address finds nothing. The JSON for the cloud has the NUL as an escape.
"""

import logging
import threading
import time
from collections.abc import Callable, Sequence
from typing import Final, cast

import psycopg
from psycopg.abc import Buffer
from psycopg.types.string import StrDumper
from sqlalchemy import Engine, text
from sqlalchemy.exc import DBAPIError

LOG = logging.getLogger(__name__)

_CHANNEL: Final = "edge_server"
_SPACING_S: Final = 0.005
_LOOK_S: Final = 0.2
_RETRY_S: Final = 1.0
_NOTIFY: Final = text(
    "SELECT set_config('synchronous_commit', 'off', true), pg_notify(:channel, :topic)"
)


class TextDumper(StrDumper):
    """Writes a text without NUL."""

    def dump(self, obj: str) -> Buffer | None:
        """Return the bytes of a text."""
        return super().dump(obj.replace("\0", "\ufffd"))


class Sender:
    """Sends notices from a thread of its own; several are sent in one transaction."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._changed = threading.Condition()
        self._topics: set[str] = set()
        self._closed = False
        self._thread: threading.Thread | None = None

    def send(self, topic: str) -> None:
        """Have a topic sent soon."""
        with self._changed:
            self._topics.add(topic)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, daemon=True)
                self._thread.start()
            self._changed.notify()

    def close(self) -> None:
        """Send what is waiting, then end."""
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
        """Return the topics to send; an empty set at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._topics or self._closed)
            topics, self._topics = self._topics, set()
            return topics


class Listener:
    """Receives notices in a thread of its own; reconnects when the connection is lost.

    `missed` are the topics that may have been sent before it listens, each time that it connects.
    """

    def __init__(
        self,
        engine: Engine,
        on_notice: Callable[[str], None],
        at_end: Callable[[], None],
        missed: Sequence[str],
    ) -> None:
        self._engine = engine
        self._on_notice = on_notice
        self._at_end = at_end
        self._missed = missed
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> "Listener":
        """Start to listen."""
        self._thread.start()
        return self

    def close(self) -> None:
        """Stop listening."""
        self._stopping.set()
        self._thread.join()
        self._at_end()

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                self._listen()
            except (DBAPIError, psycopg.Error) as error:
                LOG.debug("no notices are received: %s", error)
                self._stopping.wait(_RETRY_S)

    def _listen(self) -> None:
        with self._engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
            connection.detach()  # Its session listens, so it must not be shared
            connection.exec_driver_sql(f"LISTEN {_CHANNEL}").close()
            driver = cast("psycopg.Connection[object]", connection.connection.dbapi_connection)
            for topic in self._missed:
                self._on_notice(topic)
            while not self._stopping.is_set():
                for notice in driver.notifies(timeout=_LOOK_S):
                    self._on_notice(notice.payload)
