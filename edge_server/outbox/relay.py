"""The relay's loop: read what is due, decide, hand to the crew, write what was answered.

RelayError  the relay cannot go on
"""

import logging
import select
import threading
import time
from pathlib import Path
from typing import Final

from sqlalchemy.exc import DBAPIError

from edge_server.outbox import queue, wakeup
from edge_server.outbox.answers import Meaning, Verdict
from edge_server.outbox.counting import RelayCounts
from edge_server.outbox.counting import Uplink as UplinkState
from edge_server.outbox.crew import Crew, WorkerDiedError
from edge_server.outbox.lanes import held_back_behind
from edge_server.outbox.ledger import Entry, Ledger
from edge_server.outbox.queue import Parcel
from edge_server.outbox.schedule import Schedule
from edge_server.outbox.states import Happening
from edge_server.outbox.streams import ReplacedError, Situation, Streams
from edge_server.outbox.uplink import Uplink
from edge_server.store.database import Database
from edge_server.store.failures import is_full

LOG = logging.getLogger(__name__)

TICK_S: Final = 1.0  # Looks by itself this often, should a wake-up be lost
STOP_WAIT_S: Final = 3.0


class RelayError(Exception):
    """The relay cannot go on; the process should start again."""


class Relay:
    """Sends what is due until it is stopped."""

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
    ) -> None:
        self._database = database
        self._streams = streams
        self._schedule = schedule
        self._uplink = uplink
        self._counts = counts
        self._crew = Crew(uplink, workers)
        self._ledger = Ledger(database, ballast_path)
        self._wake = wake
        self._look_at = 0.0
        self._stopping = threading.Event()
        self._uplink_was = UplinkState.OPEN

    def stop(self) -> None:
        """End `run` soon; may be called from a signal handler or another thread."""
        self._stopping.set()
        self._crew.ring()

    def run(self) -> None:
        """Relay until `stop`."""
        self._crew.start()
        if self._counts is not None:
            self._counts.uplink(self._uplink_was)
        try:
            while not self._stopping.is_set():
                self._turn(time.monotonic())
            self._finish(time.monotonic() + STOP_WAIT_S)
        except (WorkerDiedError, ReplacedError) as error:
            raise RelayError(str(error)) from error
        finally:
            self._crew.dismiss()
            self._streams.close()
            wakeup.close(self._wake)

    def _turn(self, now: float) -> None:
        self._collect(now)
        self._look_unless_full(now)
        if not self._ledger.is_full:
            for shipment in self._schedule.take(now, self._uplink.offer()):
                self._crew.send(shipment)
        if self._ledger.is_due(now, idle=not self._schedule.flying):
            self._write(now)
        self._wait()

    def _finish(self, deadline: float) -> None:
        """Wait a little for answers under way, so that they need not be asked for again."""
        while self._schedule.flying and (left := deadline - time.monotonic()) > 0:
            select.select([self._crew.bell], [], [], left)
            self._collect(time.monotonic())
        self._write(time.monotonic())

    def _collect(self, now: float) -> None:
        wall_clock = time.time()
        for shipment, said in self._crew.answers():
            verdicts = held_back_behind(shipment.parcels, said)
            happenings = self._schedule.settle(shipment, verdicts, now)
            for entry in map(Entry, shipment.parcels, happenings, verdicts):
                self._ledger.note(entry, now)
                if self._counts is not None:
                    self._counts.answered(entry.parcel, entry.verdict, wall_clock)
                if entry.happening is Happening.REJECTED:
                    _tell_of_dead_letter(entry.parcel, entry.verdict)
            self._tell(verdicts)

    def _look_unless_full(self, now: float) -> None:
        """Read what has come; on a full disk even that may need room, which we then make."""
        try:
            self._look(now)
        except DBAPIError as error:
            if not is_full(error):
                raise
            LOG.warning("the disk is full, nothing can be read: %s", error.orig)
            self._ledger.give_way()
            self._look_at = now + TICK_S

    def _look(self, now: float) -> None:
        """Read what has come; a wake-up that says so makes us forget what we had read ahead."""
        signals = wakeup.drain(self._wake)
        if wakeup.CHANGED in signals:
            self._write(now)
            self._schedule.rewind()
        if signals or now >= self._look_at:
            self._look_at = now + TICK_S
            news, gone = self._streams.look(self._situation(now))
            self._schedule.forget(gone)
            self._schedule.announce(news)
        if hungry := self._schedule.hungry():
            with self._database.read() as connection:
                for stream, after_id, limit in hungry:
                    parcels = queue.heads(connection, stream, after_id, limit)
                    self._schedule.feed(stream, parcels, limit)

    def _situation(self, now: float) -> Situation:
        unwritten = self._ledger.streams
        flying = self._schedule.in_flight() | unwritten
        busy = self._schedule.busy() | unwritten
        return Situation(now, not self._schedule.blocked, busy, flying)

    def _write(self, now: float) -> None:
        if self._ledger.write(now, time.time()):
            self._schedule.rewind()

    def _wait(self) -> None:
        now = time.monotonic()
        times = [self._look_at, self._schedule.next_due(now), self._ledger.due_at()]
        soonest = min(moment for moment in times if moment is not None)
        # A `stop` whose byte has been drained already is seen here; a later one ends the select.
        timeout = 0.0 if self._stopping.is_set() else max(soonest - now, 0.0)
        select.select([self._wake, self._crew.bell], [], [], timeout)

    def _tell(self, verdicts: list[Verdict]) -> None:
        """Log what an operator should know: once per change, not once per record."""
        uplink = self._uplink_state()
        if uplink == self._uplink_was:
            return
        if self._counts is not None:
            self._counts.uplink(uplink)
        reason = next((v.reason for v in verdicts if v.meaning is not Meaning.HELD_BACK), "")
        if uplink is UplinkState.PAUSED:
            LOG.error("uplink paused: %s; check the cloud's key", reason)
        elif uplink is UplinkState.BLOCKED:
            LOG.warning("cloud not reachable: %s; records are kept", reason)
        else:
            LOG.info("cloud reachable again")
        self._uplink_was = uplink

    def _uplink_state(self) -> UplinkState:
        if self._schedule.paused:
            return UplinkState.PAUSED
        return UplinkState.BLOCKED if self._schedule.blocked else UplinkState.OPEN


def _tell_of_dead_letter(parcel: Parcel, verdict: Verdict) -> None:
    name = f"{parcel.stream.kind} {parcel.record_id}"
    LOG.error("dead letter: %s of vehicle %d: %s", name, parcel.stream.vehicle_id, verdict.reason)
