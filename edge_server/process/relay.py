"""The relay as a process: waits for the database, takes the lock, relays until stopped.

LockedError  another relay runs on this state folder
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

from edge_server.config import Config, make_state_folder
from edge_server.outbox import wakeup
from edge_server.outbox.counts import RelayCounts
from edge_server.outbox.relay import Relay, RelayError
from edge_server.outbox.retry import Backoff
from edge_server.outbox.schedule import Schedule
from edge_server.outbox.streams import AllStreams, SharedStreams, Streams
from edge_server.outbox.uplink import Uplink
from edge_server.relay_health import Activity
from edge_server.store import migrate
from edge_server.store.connection.database import Database, Topic
from edge_server.store.connection.engines import open_engine
from edge_server.store.connection.failures import is_lost
from edge_server.store.files import integrity
from edge_server.store.files.read_only import wait_until_writable
from edge_server.store.files.tally import Tally
from edge_server.uplinks.mqtt_protocol import is_mqtt

LOG = logging.getLogger(__name__)
LOCK_PATIENCE_S: Final = 3.0
SHARED_PATIENCE_S: Final = 0.5
RETAKE_S: Final = 1.0
"""A surviving relay takes the lock of one that has exited within this time."""
_LOOK_S: Final = 0.1


class LockedError(Exception):
    """Another relay runs on this state folder; two would send records out of order."""


def run(config: Config) -> None:
    """Relay until SIGTERM or SIGINT; waits for a database server that does not answer.

    Raises:
        ConfigError: if the state folder cannot be created.
        LockedError: if another relay runs.
        RelayError: if it cannot go on and should be started again.
    """
    make_state_folder(config)
    stopping = threading.Event()
    _at_first_signal(stopping.set)
    wait_until_writable(config.edge_dir, stopping.wait)
    if stopping.is_set():
        return
    lock = StateFolderLock(config)
    try:
        lock.keep_trying(stopping)
        while not stopping.is_set() and _wait_for_database(
            config.database, stopping, lock.note_activity
        ):
            _relay_once(config, stopping, lock.note_activity)
    finally:
        stopping.set()
        lock.close()


class StateFolderLock:
    """The lock of the state folder, which shows that a relay runs here.

    Relays on PostgreSQL share the streams: one holds the lock, and another takes it within
    `RETAKE_S` when that one exits. `relay_health` takes the lock for a moment, so the first attempt
    lasts longer than that.
    """

    def __init__(self, config: Config) -> None:
        """Acquire the lock.

        Raises:
            LockedError: if another relay holds it and the database is our own file.
        """
        self._config = config
        self._path = config.relay_lock_path
        self._lock = threading.Lock()
        self._is_closed = False
        is_shared = config.database_url is not None
        try:
            patience_s = SHARED_PATIENCE_S if is_shared else LOCK_PATIENCE_S
            self._descriptor: int | None = take_lock(self._path, patience_s)
            self._activity: Activity | None = Activity(config)
        except LockedError:
            if not is_shared:
                raise
            self._descriptor = self._activity = None

    @property
    def is_held(self) -> bool:
        """Whether this process holds it."""
        return self._descriptor is not None

    def note_activity(self) -> None:
        """Note that the loop of this process runs, if it holds the lock."""
        if (activity := self._activity) is not None:
            activity.note()

    def keep_trying(self, stopping: threading.Event) -> None:
        """Acquire it in a thread as soon as it is free, unless it is held."""
        if not self.is_held:
            threading.Thread(target=self._take_over, args=(stopping,), daemon=True).start()

    def try_again(self) -> bool:
        """Acquire it if it is free; returns whether it is held."""
        with self._lock:
            if not self.is_held and not self._is_closed:
                with contextlib.suppress(LockedError, OSError):  # Or no descriptor is left
                    self._descriptor = take_lock(self._path, 0.0)
                    self._activity = Activity(self._config)
            return self.is_held

    def close(self) -> None:
        """Release it."""
        with self._lock:
            self._is_closed = True
            if self._descriptor is not None:
                os.close(self._descriptor)
                self._descriptor = None

    def _take_over(self, stopping: threading.Event) -> None:
        while not stopping.wait(RETAKE_S):
            if self.try_again():
                LOG.info("the relay that held %s has exited; this one holds it now", self._path)
                return


def _relay_once(
    config: Config, stopping: threading.Event, note_activity: Callable[[], None]
) -> None:
    """Relay until stopped, or until the connection to the database is lost."""
    database = Database(open_engine(config.database))
    try:
        relay = build(config, database, note_activity)
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
    """Stop a relay at a signal, which may have arrived already."""

    def stop() -> None:
        stopping.set()
        relay.stop()

    if not stopping.is_set():
        _at_first_signal(stop)
    if stopping.is_set():
        relay.stop()


def _at_first_signal(end: Callable[[], None]) -> None:
    """Shut down at the first signal; the second one kills the process."""

    def handle(*_: object) -> None:
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, signal.SIG_DFL)
        end()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, handle)


def build(
    config: Config, database: Database, note_activity: Callable[[], None] = lambda: None
) -> Relay:
    """Build a relay."""
    schedule = Schedule(
        backoff=Backoff(config.backoff_base_s, config.backoff_cap_s),
        probe_interval_s=config.probe_interval_s,
        workers=config.relay_workers,
        random=Random(),
    )
    return Relay(
        database=database,
        schedule=schedule,
        uplink=_uplink(config),
        streams=_streams(config, database),
        wake=_wake(config, database),
        ballast_path=None if database.is_shared else config.ballast_path,
        workers=config.relay_workers,
        counts=RelayCounts(Tally(config.relay_tally_path)),
        note_activity=note_activity,
    )


def _uplink(config: Config) -> Uplink:
    """Build the uplink of the cloud's address, and load the client of its protocol alone."""
    if is_mqtt(config.cloud_url):
        from edge_server.uplinks.mqtt import MqttUplink  # noqa: PLC0415  # paho takes memory

        return MqttUplink(config)
    from edge_server.uplinks.cloud_http import HttpUplink  # noqa: PLC0415  # requests, as above

    return HttpUplink(config)


def _streams(config: Config, database: Database) -> Streams:
    if not database.is_shared:
        return AllStreams(database, config.database_path)
    return SharedStreams(database.engine)


def _wake(config: Config, database: Database) -> int:
    """Give the descriptor that wakes the relay: the server's pipe, or one for notices."""
    if not database.is_shared:
        return wakeup.open_for_reading(config.wake_path)
    read_end, write_end = wakeup.open_pair()
    database.listen(
        lambda topic: wakeup.write(write_end, changed=topic == Topic.CHANGED),
        at_end=lambda: wakeup.close(write_end),
    )
    return read_end


def take_lock(path: Path, patience_s: float) -> int:
    """Acquire the lock of the state folder; the kernel releases it with the process.

    A killed predecessor may still hold it for a moment, hence `patience_s`.

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
                    f"another relay runs on this state folder ({path} is locked)"
                ) from None
            time.sleep(_LOOK_S)
        else:
            return descriptor


def _wait_for_database(
    url: str, stopping: threading.Event, note_activity: Callable[[], None]
) -> bool:
    """Wait until a server has created the tables; false if stopped before."""
    log_at = time.monotonic() + 5.0
    while not migrate.is_ready(url):
        note_activity()
        if stopping.wait(_LOOK_S):
            return False
        if time.monotonic() > log_at:
            LOG.info("waiting for the server to prepare the database")
            log_at = float("inf")
    return True
