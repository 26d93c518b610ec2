"""The relay's loop: read queued records, choose, pass them to the senders, write the results.

RelayError  the relay cannot go on
"""

import logging
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from sqlalchemy.exc import DBAPIError

from edge_server.outbox import queue, wakeup
from edge_server.outbox.answers import Outcome, Result
from edge_server.outbox.counts import RelayCounts, UplinkState
from edge_server.outbox.queue import OutboxRecord, Trigger
from edge_server.outbox.result_writer import RecordResult, ResultWriter
from edge_server.outbox.schedule import Schedule, only_behind_others
from edge_server.outbox.senders import SenderEndedError, SenderPool
from edge_server.outbox.streams import RelayStatus, ReplacedError, Streams
from edge_server.outbox.uplink import Uplink
from edge_server.store.connection.database import Database
from edge_server.store.connection.failures import is_full

LOG = logging.getLogger(__name__)

TICK_S: Final = 1.0  # Looks by itself this often, in case a wake-up is lost
STOP_WAIT_S: Final = 3.0


class RelayError(Exception):
    """The relay cannot go on; the process should start again."""


class Relay:
    """Sends queued records until it is stopped."""

    def __init__(
        self,
        *,
        database: Database,
        schedule: Schedule,
        uplink: Uplink,
        streams: Streams,
        wake: int,
        workers: int,
        ballast_path: Path | None = None,
        counts: RelayCounts | None = None,
        note_activity: Callable[[], None] = lambda: None,
        wall_clock: Callable[[], float] = time.time,
    ) -> None:
        """Use these parts; `wall_clock` gives seconds since 1970.

        `note_activity` is called in each turn of `run`, which takes `TICK_S` at most while idle.
        Without `workers` each step sends on the caller's thread.
        """
        self._database = database
        self._streams = streams
        self._schedule = schedule
        self._uplink = uplink
        self._counts = counts
        self._note_activity = note_activity
        self._wall_clock = wall_clock
        self._senders = SenderPool(uplink, workers)
        self._writer = ResultWriter(database, ballast_path, schedule.is_overtaken)
        self._wake = wake
        self._look_at = 0.0
        self._stopping = threading.Event()
        self._last_state = UplinkState.OPEN

    def stop(self) -> None:
        """End `run` soon; may be called from a signal handler or another thread."""
        self._stopping.set()
        self._senders.wake()

    def run(self) -> None:
        """Relay until `stop`."""
        self._senders.start()
        if self._counts is not None:
            self._counts.set_uplink(self._last_state)
        try:
            while not self._stopping.is_set():
                self._note_activity()
                self.step(time.monotonic())
                self._wait()
            self._finish(time.monotonic() + STOP_WAIT_S)
        except (SenderEndedError, ReplacedError) as error:
            raise RelayError(str(error)) from error
        finally:
            self.close()

    def close(self) -> None:
        """Close the uplink and what wakes the relay."""
        self._senders.close()
        self._streams.close()
        wakeup.close(self._wake)

    def step(self, now: float) -> None:
        """Process answers, read new records, send, and write results, without waiting."""
        self._collect(now)
        self._look_unless_full(now)
        if not self._writer.is_full:
            for batch in self._schedule.take(now, self._uplink.batch_limit()):
                self._writer.note_sending(batch.records)
                self._senders.send(batch)
        if self._writer.is_due(now, idle=not self._schedule.batches_in_flight):
            self._write(now)

    def _finish(self, deadline: float) -> None:
        """Wait briefly for answers in flight, so that these records need not be sent again."""
        while self._schedule.batches_in_flight and (left := deadline - time.monotonic()) > 0:
            wakeup.wait([self._senders.descriptor], left)
            self._collect(time.monotonic())
        self._write(time.monotonic())

    def _collect(self, now: float) -> None:
        wall_clock = self._wall_clock()
        for batch, answered in self._senders.take_sent():
            results = only_behind_others(batch.records, answered)
            triggers = self._schedule.settle(batch, results, now)
            for one in map(RecordResult, batch.records, triggers, results):
                self._writer.add(one, now)
                if self._counts is not None:
                    self._counts.count(one.record, one.result, wall_clock)
                if one.trigger is Trigger.REJECTED:
                    _log_dead_letter(one.record, one.result)
            self._log_state(results)

    def _look_unless_full(self, now: float) -> None:
        """Read new records; on a full disk even reading may need room, which is made then."""
        try:
            self._look(now)
        except DBAPIError as error:
            if not is_full(error):
                raise
            LOG.warning("the disk is full, nothing can be read: %s", error.orig)
            self._writer.make_room()
            self._look_at = now + TICK_S

    def _look(self, now: float) -> None:
        """Read new records; after a change of existing rows, read everything again."""
        signals = wakeup.drain(self._wake)
        if wakeup.CHANGED in signals:
            self._write(now)
            self._schedule.rewind()
        if signals or now >= self._look_at:
            self._look_at = now + TICK_S
            new, gone = self._streams.look(self._status(now))
            self._schedule.drop(gone)
            self._schedule.announce(new)
        if to_read := self._schedule.to_read():
            with self._database.read() as connection:
                for stream, after_id, limit in to_read:
                    records = queue.read_queued(connection, stream, after_id, limit)
                    self._schedule.feed(stream, records, limit)

    def _status(self, now: float) -> RelayStatus:
        unwritten = self._writer.streams
        in_flight = self._schedule.in_flight() | unwritten
        busy = self._schedule.busy() | unwritten
        return RelayStatus(now, not self._schedule.blocked, busy, in_flight)

    def _write(self, now: float) -> None:
        if self._writer.write(now, self._wall_clock()):
            self._schedule.rewind()

    def next_due(self, now: float) -> float | None:
        """When a record or a result is due; None if `step` has nothing to do until it is woken."""
        times = (self._schedule.next_due(now), self._writer.due_at())
        return min((moment for moment in times if moment is not None), default=None)

    def _wait(self) -> None:
        now = time.monotonic()
        due = self.next_due(now)
        soonest = self._look_at if due is None else min(self._look_at, due)
        # A `stop` whose byte has been drained already is seen here; a later one ends the wait.
        timeout = 0.0 if self._stopping.is_set() else max(soonest - now, 0.0)
        wakeup.wait([self._wake, self._senders.descriptor], timeout)

    def _log_state(self, results: list[Result]) -> None:
        """Log the state of the uplink: once per change, not once per record."""
        state = self._uplink_state()
        if state == self._last_state:
            return
        if self._counts is not None:
            self._counts.set_uplink(state)
        reason = next((one.reason for one in results if one.outcome is not Outcome.HELD_BACK), "")
        if state is UplinkState.PAUSED:
            LOG.error("uplink paused: %s; check the cloud's key", reason)
        elif state is UplinkState.BLOCKED:
            LOG.warning("cloud not reachable: %s; records are kept", reason)
        else:
            LOG.info("cloud reachable again")
        self._last_state = state

    def _uplink_state(self) -> UplinkState:
        if self._schedule.paused:
            return UplinkState.PAUSED
        return UplinkState.BLOCKED if self._schedule.blocked else UplinkState.OPEN


def _log_dead_letter(record: OutboxRecord, result: Result) -> None:
    name = f"{record.stream.kind} {record.record_id}"
    LOG.error("dead letter: %s of vehicle %d: %s", name, record.stream.vehicle_id, result.reason)
