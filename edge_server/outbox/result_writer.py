"""Results of deliveries that are not in the database yet; they are written in groups.

The cloud confirms, then record, outbox row and tombstone change in one transaction. After a crash
between the two, the record is sent again under the same key.
"""

import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from sqlalchemy.exc import OperationalError

from edge_server.outbox import queue
from edge_server.outbox.answers import Outcome, Result
from edge_server.outbox.queue import Delivered, OutboxRecord, Stream, Trigger
from edge_server.outbox.steady_clock import SteadyClock
from edge_server.store.connection.database import Database
from edge_server.store.connection.failures import is_full
from edge_server.store.files import ballast, upkeep
from edge_server.store.files.upkeep import CheckpointResult

LOG = logging.getLogger(__name__)

GROUP: Final = 128  # Written in one transaction once there are so many, or more
GROUP_WAIT_S: Final = 0.02
RETRY_S: Final = 1.0
MAXIMUM_PENDING: Final = 1024  # While so many cannot be written, nothing more is sent
TOMBSTONES_KEPT_S: Final = 7 * 86400.0
HOUSEKEEPING_S: Final = 600.0


class RecordResult(NamedTuple):
    """The result of one attempt to deliver one record."""

    record: OutboxRecord
    trigger: Trigger
    result: Result


class ResultWriter:
    """Times are monotonic seconds, except those named wall clock."""

    def __init__(
        self,
        database: Database,
        ballast_path: Path | None = None,
        is_overtaken: Callable[[OutboxRecord], bool] = lambda _: False,
    ) -> None:
        """`is_overtaken` is that of the schedule."""
        self._database = database
        self._is_overtaken = is_overtaken
        self._ballast_path = ballast_path
        self._pending: list[RecordResult] = []
        self._since = 0.0
        self._not_before = 0.0
        self._clean_at = 0.0
        self._steady_clock = SteadyClock()
        self._at_once = GROUP

    @property
    def is_full(self) -> bool:
        """Whether the relay has to wait until something can be written."""
        return len(self._pending) >= MAXIMUM_PENDING

    def note_sending(self, records: Sequence[OutboxRecord]) -> None:
        """Store which mission reports are about to be sent; they are sent on a full disk too."""
        reports = [one for one in records if one.stream.kind == queue.MISSION_REPORT]
        if not reports:
            return
        try:
            with self._database.write() as connection:
                queue.mark_sent(connection, reports)
        except OperationalError as error:
            LOG.warning("it is not stored that reports are being sent: %s", error.orig)

    @property
    def streams(self) -> set[Stream]:
        """Streams with a result that is not written yet."""
        return {one.record.stream for one in self._pending}

    def add(self, result: RecordResult, now: float) -> None:
        """Keep a result until it is written."""
        if not self._pending:
            self._since = now
        self._pending.append(result)

    def due_at(self) -> float | None:
        """When to write at the latest; None if nothing is pending."""
        return max(self._since + GROUP_WAIT_S, self._not_before) if self._pending else None

    def is_due(self, now: float, *, idle: bool) -> bool:
        """Whether to write now; while nothing is in flight there is nothing to wait for."""
        if now < self._not_before:
            return False
        if now >= self._clean_at:
            return True
        gathered = len(self._pending) >= GROUP or now - self._since >= GROUP_WAIT_S
        return bool(self._pending) and (gathered or idle)

    def write(self, now: float, wall_clock: float) -> bool:
        """Write all pending results in groups; keep what cannot be written now.

        After the disk was full the groups are smaller: deleting takes room too, and a small group
        needs little. Returns whether a record was changed while it was in flight.
        """
        changed = False
        self._steady_clock.watch(wall_clock, now)
        while self._pending or now >= self._clean_at:
            group = self._pending[: self._at_once]
            try:
                changed |= self._write(group, now, wall_clock)
            except OperationalError as error:
                LOG.warning("cannot write what the cloud has confirmed: %s", error.orig)
                has_room = is_full(error) and self.make_room(len(group))
                self._not_before = now + (0.0 if has_room else RETRY_S)
                break
            del self._pending[: len(group)]
            self._at_once = min(2 * self._at_once, GROUP)
        return changed

    def make_room(self, failed: int = 0) -> bool:
        """Make room on a full disk, or need less of it; returns whether to try again at once.

        `failed` is the size of the group for which there was no room, 0 if it was another access.
        """
        if upkeep.checkpoint(self._database) is CheckpointResult.DONE and failed > 1:
            self._at_once = max(failed // 8, 1)
            return True
        if self._ballast_path is not None and ballast.release(self._ballast_path):
            LOG.warning("the disk is full; the ballast %s is released", self._ballast_path)
            return True
        self._at_once = max(failed // 8, 1)
        return failed > 1

    def _write(self, results: Sequence[RecordResult], now: float, wall_clock: float) -> bool:
        with self._database.write() as connection:
            delivered = [
                Delivered(one.record, one.result.status)
                for one in results
                if one.trigger is Trigger.CONFIRMED
            ]
            changed = queue.delete_delivered(connection, delivered, wall_clock)
            for record, trigger, result in results:
                attempts = record.attempts + 1
                if trigger is Trigger.REJECTED:
                    if not queue.mark_dead(connection, record, attempts, result.reason, wall_clock):
                        changed.append(record)
                elif trigger is not Trigger.CONFIRMED and result.outcome is not Outcome.HELD_BACK:
                    queue.note_failure(connection, record, attempts, result.reason)
            sent = [one.record for one in results]
            for record in filter(self._is_overtaken, changed):
                if queue.hold_back_correction(connection, record, sent, wall_clock):
                    LOG.error(
                        "dead letter: mission_report %d of vehicle %d: %s",
                        *(record.record_id, record.stream.vehicle_id, queue.OVERTAKEN),
                    )
            if now >= self._clean_at and self._steady_clock.is_steady(now):
                queue.delete_tombstones(connection, wall_clock - TOMBSTONES_KEPT_S)
        self._clean_at = max(self._clean_at, now + HOUSEKEEPING_S * (now >= self._clean_at))
        return bool(changed)
