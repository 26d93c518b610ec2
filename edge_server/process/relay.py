"""The relay as a process: waits for the database, takes the lock, relays until stopped.

LockedError  another relay serves this state folder
"""

import contextlib
import fcntl
import logging
import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Final

from sqlalchemy.exc import DBAPIError

from edge_server.config import Config
from edge_server.outbox import wakeup
from edge_server.outbox.counting import RelayCounts
from edge_server.outbox.relay import Relay, RelayError
from edge_server.outbox.retry import Backoff
from edge_server.outbox.schedule import Schedule
from edge_server.outbox.streams import AllStreams, Streams
from edge_server.store import integrity, migrate
from edge_server.store.database import Database, Topic
from edge_server.store.engines import open_engine
from edge_server.store.failures import is_lost
from edge_server.store.tally import Tally
from edge_server.uplinks.cloud_http import HttpUplink
from edge_server.uplinks.mqtt import MqttUplink
from edge_server.uplinks.mqtt_topics import is_mqtt

LOG = logging.getLogger(__name__)
LOCK_PATIENCE_S: Final = 3.0
SHARED_PATIENCE_S: Final = 0.5
RETAKE_S: Final = 1.0
"""After so long at most a relay that lives on holds the lock of one that died."""
_LOOK_S: Final = 0.1


class LockedError(Exception):
    """Another relay serves this state folder; two would send records out of order."""


def run(config: Config) -> None:
    """Relay until SIGTERM or SIGINT; a database server that is away is waited for.

    Raises:
        LockedError: if another relay runs.
        RelayError: if it cannot go on and should be started again.
    """
    config.edge_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
    stopping = threading.Event()
    lock = StateFolderLock(config)
    _at_first_signal(stopping.set)
    try:
        lock.keep_trying(stopping)
        while not stopping.is_set() and _wait_for_database(config.database, stopping):
            _relay_once(config, stopping)
    finally:
        stopping.set()
        lock.close()


class StateFolderLock:
    """The state folder's lock, which shows that a relay runs here.

    Of relays on PostgreSQL, which share the streams, one has it and the others take it over within
    `RETAKE_S` when that one dies. A look at the lock holds it for a moment (`relay_health`), so
    they try for longer than that at first.
    """

    def __init__(self, config: Config) -> None:
        """Take the lock.

        Raises:
            LockedError: if another relay holds it and the database is our own file.
        """
        self._path = config.relay_lock_path
        self._guard = threading.Lock()
        self._is_closed = False
        is_shared = config.database_url is not None
        try:
            patience_s = SHARED_PATIENCE_S if is_shared else LOCK_PATIENCE_S
            self._descriptor: int | None = take_lock(self._path, patience_s)
        except LockedError:
            if not is_shared:
                raise
            self._descriptor = None

    @property
    def is_held(self) -> bool:
        """Whether it is ours."""
        return self._descriptor is not None

    def keep_trying(self, stopping: threading.Event) -> None:
        """Take it in a thread as soon as it is free, unless it is ours already."""
        if not self.is_held:
            threading.Thread(target=self._take_over, args=(stopping,), daemon=True).start()

    def try_again(self) -> bool:
        """Take it if it is free; returns whether it is ours."""
        with self._guard:
            if not self.is_held and not self._is_closed:
                with contextlib.suppress(LockedError, OSError):  # Or no descriptor is left
                    self._descriptor = take_lock(self._path, 0.0)
            return self.is_held

    def close(self) -> None:
        """Release it."""
        with self._guard:
            self._is_closed = True
            if self._descriptor is not None:
                os.close(self._descriptor)
                self._descriptor = None

    def _take_over(self, stopping: threading.Event) -> None:
        while not stopping.wait(RETAKE_S):
            if self.try_again():
                LOG.info("the relay that held %s is gone; this one holds it now", self._path)
                return


def _relay_once(config: Config, stopping: threading.Event) -> None:
    """Relay until we are told to stop, or the database server hangs up."""
    database = Database(open_engine(config.database))
    try:
        relay = build(config, database)
        _stop_with(relay, stopping)
        LOG.info("relaying to %s", config.cloud_url)
        relay.run()
    except DBAPIError as error:
        if integrity.is_broken(error):
            integrity.note_fault(config.database_path, str(error.orig))
            raise RelayError(f"the database is broken: {error.orig}") from None
        if not is_lost(error):
            raise
        LOG.warning("the database does not answer; waiting for it: %s", error.orig)
    finally:
        database.close()


def _stop_with(relay: Relay, stopping: threading.Event) -> None:
    """End a relay when we are told to stop, now or later."""

    def stop() -> None:
        stopping.set()
        relay.stop()

    if not stopping.is_set():
        _at_first_signal(stop)
    if stopping.is_set():
        relay.stop()


def _at_first_signal(end: Callable[[], None]) -> None:
    """End in order at the first signal; the second one finds no handler and ends us at once."""

    def handle(*_: object) -> None:
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, signal.SIG_DFL)
        end()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, handle)


def build(config: Config, database: Database) -> Relay:
    """Put a relay together."""
    schedule = Schedule(
        backoff=Backoff(config.backoff_base_s, config.backoff_cap_s),
        probe_interval_s=config.probe_interval_s,
        workers=config.relay_workers,
        random=Random(),
    )
    return Relay(
        database=database,
        schedule=schedule,
        uplink=MqttUplink(config) if is_mqtt(config.cloud_url) else HttpUplink(config),
        streams=_streams(config, database),
        wake=_wake(config, database),
        ballast_path=None if database.is_shared else config.database_path.with_name("ballast"),
        workers=config.relay_workers,
        counts=RelayCounts(Tally(config.relay_tally_path)),
    )


def _streams(config: Config, database: Database) -> Streams:
    if not database.is_shared:
        return AllStreams(database, config.database_path)
    from edge_server.outbox.sharing import SharedStreams  # noqa: PLC0415  # only PostgreSQL needs it

    return SharedStreams(database.engine)


def _wake(config: Config, database: Database) -> int:
    """Give the descriptor at which the relay is woken: the pipe, or what the notices come to."""
    if not database.is_shared:
        return wakeup.open_for_reading(config.wake_path)
    read_end, write_end = wakeup.open_pair()
    database.listen(
        lambda topic: wakeup.write(write_end, changed=topic == Topic.CHANGED),
        at_end=lambda: wakeup.close(write_end),
    )
    return read_end


def take_lock(path: Path, patience_s: float) -> int:
    """Take the lock of the state folder; it goes with the process.

    One that our own killed predecessor still holds is free in a moment, hence the patience.

    Raises:
        LockedError: if another relay holds it for longer than `patience_s`.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    deadline = time.monotonic() + patience_s
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > deadline:
                os.close(descriptor)
                raise LockedError(
                    f"another relay serves this state folder ({path} is locked)"
                ) from None
            time.sleep(_LOOK_S)
        else:
            return descriptor


def _wait_for_database(url: str, stopping: threading.Event) -> bool:
    """Wait until a server has made the tables; false when we should stop instead."""
    told = time.monotonic() + 5.0
    while not migrate.is_ready(url):
        if stopping.wait(_LOOK_S):
            return False
        if time.monotonic() > told:
            LOG.info("waiting for the server to prepare the database")
            told = float("inf")
    return True
