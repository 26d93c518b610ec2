"""An edge server whose time is ours: real database, real decisions, no threads and no sockets.

The relay's turns are made by hand, so that days of outage pass in seconds. The cloud keeps each
record once per key and can be away, lose answers, or answer as the test sets.
"""

import json
import os
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from random import Random

from afarcloud.state import Report
from afarcloud.wire import Kind, read
from edge_server.config import Config
from edge_server.outbox import queue, wakeup
from edge_server.outbox.answers import Answer, Reply, Unreachable, classify
from edge_server.outbox.queue import OutboxRecord, Stream
from edge_server.outbox.result_writer import RecordResult, ResultWriter
from edge_server.outbox.retry import Backoff
from edge_server.outbox.schedule import Batch, Schedule
from edge_server.outbox.uplink import ONE_BY_ONE, BatchLimit
from edge_server.services.context import Context
from edge_server.services.errors import FullError
from edge_server.services.reports import telemetry
from edge_server.services.reports.telemetry import Arrival
from edge_server.store.connection.database import Database
from edge_server.store.connection.engines import open_engine
from tests.support.databases import count_outbox
from tests.unit.edge_server import documents

NOON = 1_795_262_400.0  # 2026-11-21T12:00:00Z
STORED = Answer(200, "application/json", b"{}")
AWAY = Unreachable("the cloud is away")
Fault = Callable[["VirtualCloud", OutboxRecord], Reply]


class VirtualCloud:
    """An uplink and what is behind it; `seen` are keys in order of arrival, kept or not."""

    def __init__(self, together: BatchLimit = ONE_BY_ONE) -> None:
        self.is_there = True
        self.faults: deque[Fault] = deque()
        self.seen: list[str] = []
        self.kept: dict[str, OutboxRecord] = {}
        self._together = together

    def batch_limit(self) -> BatchLimit:
        return self._together

    def send(self, records: Sequence[OutboxRecord]) -> list[Reply]:
        return [self._answer(record) for record in records]

    def close(self) -> None:
        """There is no connection."""

    def _answer(self, record: OutboxRecord) -> Reply:
        if not self.is_there:
            return AWAY
        self.seen.append(record.message_id)
        if self.faults:
            return self.faults.popleft()(self, record)
        return self.keep(record)

    def keep(self, record: OutboxRecord) -> Reply:
        self.kept.setdefault(record.message_id, record)
        return STORED

    def stream(self, vehicle_id: int, kind: str) -> list[int]:
        """Sequence numbers kept of a stream, in the order of their arrival."""
        stream = Stream(vehicle_id, kind)
        return [
            json.loads(record.payload)["sequence_number"]
            for record in self.kept.values()
            if record.stream == stream
        ]


def answering(status: int) -> Fault:
    """Answer with a status and keep nothing."""
    return lambda _cloud, _parcel: Answer(status)


def lose_answer(cloud: VirtualCloud, record: OutboxRecord) -> Reply:
    """Keep the record and lose the answer."""
    cloud.keep(record)
    return Unreachable("no answer in time")


class VirtualStation:
    """Ingest, relay and housekeeping on a clock that the test advances."""

    def __init__(self, config: Config, cloud: VirtualCloud | None = None) -> None:
        self.cloud = cloud or VirtualCloud()
        self.config = replace(config, backoff_base_s=1.0, backoff_cap_s=300.0)
        self.passed_s = 0.0
        self.dropped: dict[tuple[str, str], int] = {}
        self._wake = wakeup.open_for_reading(self.config.wake_path)
        self._open()

    def _open(self) -> None:
        self.database = Database(open_engine(self.config.database))
        self.context = Context(self.config, self.database, lambda: NOON + self.passed_s)
        self.context.space.count = self._count
        self._schedule = Schedule(
            backoff=Backoff(self.config.backoff_base_s, self.config.backoff_cap_s),
            probe_interval_s=self.config.probe_interval_s,
            workers=self.config.relay_workers,
            random=Random(1),
        )
        self._writer = ResultWriter(self.database, is_overtaken=self._schedule.is_overtaken)
        self._newest_row = 0

    def _count(self, kind: str, reason: str, number: int) -> None:
        self.dropped[kind, reason] = self.dropped.get((kind, reason), 0) + number

    def restart(self) -> None:
        """Forget everything but the disk."""
        self.database.close()
        self._open()

    def close(self) -> None:
        self.database.close()
        os.close(self._wake)

    def pass_s(self, seconds: float) -> None:
        self.passed_s += seconds

    def ingest(self, kind: str, *sequence_numbers: int, vehicle_id: int = 1) -> list[str]:
        """Keep records in one transaction; returns their ids, raises for the first refused."""
        arrivals = []
        for number in sequence_numbers:
            report = read(Kind(kind), documents.telemetry(kind, number, vehicle_id))
            assert isinstance(report, Report)
            arrivals.append(Arrival(Kind(kind), report, None))
        keys = []
        for outcome in telemetry.ingest_all(self.context, arrivals, "broker"):
            if not isinstance(outcome, dict):
                raise outcome
            keys.append(str(outcome["message_id"]))
        return keys

    def ingest_all(self, arrivals: Sequence[Arrival]) -> list[bool]:
        """Keep many as the broker's bulk does; returns of each whether it was accepted."""
        outcomes = telemetry.ingest_all(self.context, arrivals, "broker")
        return [not isinstance(outcome, FullError) for outcome in outcomes]

    def send_next(self) -> list[Batch]:
        """What the relay would hand to its threads now."""
        if wakeup.CHANGED in wakeup.drain(self._wake):
            self._write()
            self._schedule.rewind()
        with self.database.read() as connection:
            streams, self._newest_row = queue.streams_after(connection, self._newest_row)
            self._schedule.announce(streams)
            for stream, after_id, limit in self._schedule.to_read():
                found = queue.read_queued(connection, stream, after_id, limit)
                self._schedule.feed(stream, found, limit)
        batches = self._schedule.take(self.passed_s, self.cloud.batch_limit())
        for batch in batches:
            self._writer.note_sending(batch.records)
        return batches

    def answered(self, batch: Batch, replies: Sequence[Reply]) -> None:
        """Apply the replies of the cloud."""
        results = [classify(reply) for reply in replies]
        triggers = self._schedule.settle(batch, results, self.passed_s)
        for entry in map(RecordResult, batch.records, triggers, results):
            self._writer.add(entry, self.passed_s)

    def relay(self) -> bool:
        """One turn of the relay; returns whether anything was sent."""
        batches = self.send_next()
        for batch in batches:
            self.answered(batch, self.cloud.send(batch.records))
        self._write()
        return bool(batches)

    def _write(self) -> None:
        if self._writer.write(self.passed_s, NOON + self.passed_s):
            self._schedule.rewind()

    def relay_for(self, seconds: float) -> None:
        """Let time pass as the relay would see it: to its next due moment, again and again."""
        end = self.passed_s + seconds
        while True:
            while self.relay():
                continue
            due = self._schedule.next_due(self.passed_s)
            if due is None or due > end:
                break
            self.passed_s = due
        self.passed_s = end

    def drain(self) -> None:
        """Relay until nothing waits, for a day at most."""
        for _ in range(24):
            self.relay_for(3600.0)
            if self.waiting() == 0:
                return
        raise AssertionError(f"{self.waiting()} records still wait after a day")

    def waiting(self) -> int:
        with self.database.read() as connection:
            return count_outbox(connection)
