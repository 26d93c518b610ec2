"""The relay's shell: threads that talk to the cloud, one loop that reads, decides and settles.

Order of things: the cloud confirms, then record, outbox row and tombstone change in one
transaction. A crash between the two sends the record again under the same key. Settling is
grouped; a stream's next record does not wait for it.

RelayError
  +- WorkerDiedError  a thread that talks to the cloud has failed
  +- ReplacedError    the database file is another one than the one that we read
"""

import logging
import os
import queue as threads_queue
import select
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final, Protocol

from sqlalchemy.exc import OperationalError

from edge_server.outbox import queue, wakeup
from edge_server.outbox.answers import Meaning, Reply, Verdict, judge
from edge_server.outbox.counting import RelayCounts, Uplink
from edge_server.outbox.queue import Delivered, Parcel
from edge_server.outbox.schedule import Schedule
from edge_server.outbox.states import Happening
from edge_server.store.database import Database

LOG = logging.getLogger(__name__)

TICK_S: Final = 1.0  # Looks by itself this often, should a wake-up be lost
GROUP: Final = 128  # Settled in one transaction, at most
GROUP_WAIT_S: Final = 0.02
STOP_WAIT_S: Final = 3.0
TOMBSTONES_KEPT_S: Final = 7 * 86400.0
HOUSEKEEPING_S: Final = 600.0


class RelayError(Exception):
    """The relay cannot go on; the process should start again."""


class WorkerDiedError(RelayError):
    """A thread that talks to the cloud has failed."""


class ReplacedError(RelayError):
    """The database file is another one than the one that we read."""


class CloudPort(Protocol):
    """How a record gets to the cloud; used by one thread."""

    def deliver(self, parcel: Parcel) -> Reply:
        """Send a record and wait for the answer; never raises for what the network does."""

    def close(self) -> None:
        """Close the connection."""


class Relay:
    """Sends what is due until it is stopped."""

    def __init__(
        self,
        *,
        database: Database,
        schedule: Schedule,
        connect: Callable[[], CloudPort],
        database_path: Path,
        wake_path: Path,
        workers: int,
        counts: RelayCounts,
    ) -> None:
        self._database = database
        self._database_path = database_path
        self._database_inode = database_path.stat().st_ino
        self._schedule = schedule
        self._connect = connect
        self._counts = counts
        counts.uplink(Uplink.OPEN)
        self._workers = workers
        self._wake = wakeup.open_for_reading(wake_path)
        self._answered_read, self._answered_write = os.pipe()
        os.set_blocking(self._answered_read, False)
        self._orders: threads_queue.SimpleQueue[Parcel | None] = threads_queue.SimpleQueue()
        self._answers: threads_queue.SimpleQueue[tuple[Parcel, Reply]] = threads_queue.SimpleQueue()
        self._unsettled: list[tuple[Parcel, Happening, Verdict]] = []
        self._unsettled_since = 0.0
        self._settle_not_before = 0.0
        self._newest_row = 0
        self._look_at = 0.0
        self._clean_at = 0.0
        self._stopping = threading.Event()
        self._a_worker_left = threading.Event()
        self._uplink_was = Uplink.OPEN

    def stop(self) -> None:
        """End `run` soon; may be called from a signal handler or another thread."""
        self._stopping.set()
        os.write(self._answered_write, b"\n")

    def run(self) -> None:
        """Relay until `stop`."""
        threads = [threading.Thread(target=self._work, daemon=True) for _ in range(self._workers)]
        for thread in threads:
            thread.start()
        while not self._stopping.is_set():
            self._turn(time.monotonic())
        self._finish(time.monotonic() + STOP_WAIT_S)
        for _ in threads:
            self._orders.put(None)
        os.close(self._wake)

    def _turn(self, now: float) -> None:
        if self._a_worker_left.is_set():
            raise WorkerDiedError("a thread of the relay ended; see the error above")
        self._collect(now)
        self._look(now)
        for parcel in self._schedule.take(now):
            self._orders.put(parcel)
        if self._settling_is_due(now):
            self._settle(now)
        self._wait(now)

    def _finish(self, deadline: float) -> None:
        """Wait a little for answers under way, so that they need not be asked for again."""
        while self._schedule.flying and (left := deadline - time.monotonic()) > 0:
            select.select([self._answered_read], [], [], left)
            self._collect(time.monotonic())
        self._settle(time.monotonic())

    def _work(self) -> None:
        """One thread: take a record, send it, hand the answer back."""
        cloud = self._connect()
        try:
            while (parcel := self._orders.get()) is not None:
                self._answers.put((parcel, cloud.deliver(parcel)))
                os.write(self._answered_write, b"\n")
        finally:
            cloud.close()
            self._a_worker_left.set()
            os.write(self._answered_write, b"\n")

    def _collect(self, now: float) -> None:
        wakeup.drain(self._answered_read)
        while not self._answers.empty():
            parcel, reply = self._answers.get()
            verdict = judge(reply)
            happening = self._schedule.settle(parcel, verdict, now)
            if not self._unsettled:
                self._unsettled_since = now
            self._unsettled.append((parcel, happening, verdict))
            self._tell(parcel, verdict)

    def _look(self, now: float) -> None:
        """Read what has come; a wake-up that says so makes us forget what we had read ahead."""
        signals = wakeup.drain(self._wake)
        if wakeup.CHANGED in signals:
            self._settle(now)
            self._schedule.rewind()
        if now >= self._look_at:
            self._check_file()
        if signals or now >= self._look_at:
            self._look_at = now + TICK_S
            with self._database.read() as connection:
                streams, self._newest_row = queue.streams_after(connection, self._newest_row)
            self._schedule.announce(streams)
        if hungry := self._schedule.hungry():
            with self._database.read() as connection:
                for stream, after_id, limit in hungry:
                    parcels = queue.heads(connection, stream, after_id, limit)
                    self._schedule.feed(stream, parcels, limit)

    def _check_file(self) -> None:
        """The server sets a broken database aside and makes a new one; then we must follow."""
        try:
            inode = self._database_path.stat().st_ino
        except FileNotFoundError:
            inode = 0
        if inode != self._database_inode:
            raise ReplacedError(f"{self._database_path} has been replaced")

    def _settling_is_due(self, now: float) -> bool:
        if now >= self._clean_at:
            return True
        if not self._unsettled or now < self._settle_not_before:
            return False
        return (
            len(self._unsettled) >= GROUP
            or now - self._unsettled_since >= GROUP_WAIT_S
            or not self._schedule.flying
        )

    def _settle(self, now: float) -> None:
        """Write what became of the records; what cannot be written now is kept for later."""
        wall_clock = time.time()
        try:
            with self._database.write() as connection:
                changed = queue.settle(
                    connection,
                    [
                        Delivered(parcel, verdict.status)
                        for parcel, happening, verdict in self._unsettled
                        if happening is Happening.CONFIRMED
                    ],
                    wall_clock,
                )
                for parcel, happening, verdict in self._unsettled:
                    attempts = parcel.attempts + 1
                    if happening is Happening.REJECTED:
                        queue.bury(connection, parcel, attempts, verdict.reason)
                    elif happening is not Happening.CONFIRMED:
                        queue.note_failure(connection, parcel, attempts, verdict.reason)
                if now >= self._clean_at:
                    queue.forget_tombstones(connection, wall_clock - TOMBSTONES_KEPT_S)
        except OperationalError as error:
            LOG.warning("cannot write what the cloud has confirmed: %s", error.orig)
            self._settle_not_before = now + TICK_S
            self._clean_at = max(self._clean_at, self._settle_not_before)
            return
        for parcel, _, verdict in self._unsettled:
            self._counts.answered(parcel, verdict, wall_clock)
        self._unsettled.clear()
        if now >= self._clean_at:
            self._clean_at = now + HOUSEKEEPING_S
        if changed:
            self._schedule.rewind()

    def _wait(self, now: float) -> None:
        times = [self._look_at]
        if (due := self._schedule.next_due(now)) is not None:
            times.append(due)
        if self._unsettled:
            times.append(max(self._unsettled_since + GROUP_WAIT_S, self._settle_not_before))
        # A `stop` whose byte has been drained already is seen here; a later one ends the select.
        timeout = 0.0 if self._stopping.is_set() else max(min(times) - time.monotonic(), 0.0)
        select.select([self._wake, self._answered_read], [], [], timeout)

    def _tell(self, parcel: Parcel, verdict: Verdict) -> None:
        """Log what an operator should know: once per change, not once per record."""
        where = {
            "kind": parcel.stream.kind,
            "vehicle_id": parcel.stream.vehicle_id,
            "record_id": parcel.record_id,
            "message_id": parcel.message_id,
        }
        if verdict.meaning is Meaning.REJECTED:
            name = f"{parcel.stream.kind} {parcel.record_id}"
            vehicle_id = parcel.stream.vehicle_id
            LOG.error(
                "dead letter: %s of vehicle %d: %s", name, vehicle_id, verdict.reason, extra=where
            )
        else:
            LOG.debug("%s: %s", verdict.meaning, verdict.reason, extra=where)
        uplink = _uplink(self._schedule)
        if uplink is self._uplink_was:
            return
        if uplink is Uplink.PAUSED:
            LOG.error("uplink paused: %s; check the cloud's key", verdict.reason, extra=where)
        elif uplink is Uplink.BLOCKED:
            LOG.warning("cloud not reachable: %s; records are kept", verdict.reason, extra=where)
        else:
            LOG.info("cloud reachable again", extra=where)
        self._uplink_was = uplink
        self._counts.uplink(uplink)


def _uplink(schedule: Schedule) -> Uplink:
    if schedule.paused:
        return Uplink.PAUSED
    return Uplink.BLOCKED if schedule.blocked else Uplink.OPEN
