"""An edge server whose time is ours: real database, real decisions, no threads and no sockets.

The relay's turns are made by hand, so that days of outage pass in seconds. The cloud keeps each
record once per key and can be away, lose answers, or say what it is told to say.
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
from edge_server.outbox.answers import Answer, Reply, Unreachable, judge
from edge_server.outbox.ledger import Entry, Ledger
from edge_server.outbox.queue import Parcel, Stream
from edge_server.outbox.retry import Backoff
from edge_server.outbox.schedule import Schedule, Shipment
from edge_server.outbox.uplink import ONE_BY_ONE, Offer
from edge_server.services import telemetry
from edge_server.services.context import Context
from edge_server.services.errors import FullError
from edge_server.services.telemetry import Arrival
from edge_server.store import telemetry as records
from edge_server.store.database import Database
from edge_server.store.engines import open_engine
from tests.unit.edge_server import documents

NOON = 1_795_262_400.0  # 2026-11-21T12:00:00Z
STORED = Answer(200, "application/json", b"{}")
AWAY = Unreachable("the cloud is away")
Fault = Callable[["VirtualCloud", Parcel], Reply]


class VirtualCloud:
    """An uplink and what is behind it; `seen` are keys in order of arrival, kept or not."""

    def __init__(self, together: Offer = ONE_BY_ONE) -> None:
        self.is_there = True
        self.faults: deque[Fault] = deque()
        self.seen: list[str] = []
        self.kept: dict[str, Parcel] = {}
        self._together = together

    def offer(self) -> Offer:
        return self._together

    def send(self, parcels: Sequence[Parcel]) -> list[Reply]:
        return [self._answer(parcel) for parcel in parcels]

    def close(self) -> None:
        """There is no connection."""

    def _answer(self, parcel: Parcel) -> Reply:
        if not self.is_there:
            return AWAY
        self.seen.append(parcel.message_id)
        if self.faults:
            return self.faults.popleft()(self, parcel)
        return self.keep(parcel)

    def keep(self, parcel: Parcel) -> Reply:
        self.kept.setdefault(parcel.message_id, parcel)
        return STORED

    def stream(self, vehicle_id: int, kind: str) -> list[int]:
        """Sequence numbers kept of a stream, in the order of their arrival."""
        stream = Stream(vehicle_id, kind)
        return [
            json.loads(parcel.payload)["sequence_number"]
            for parcel in self.kept.values()
            if parcel.stream == stream
        ]


def saying(status: int) -> Fault:
    """Answer with a status and keep nothing."""
    return lambda _cloud, _parcel: Answer(status)


def lose_answer(cloud: VirtualCloud, parcel: Parcel) -> Reply:
    """Keep the record and say nothing."""
    cloud.keep(parcel)
    return Unreachable("no answer in time")


class VirtualStation:
    """Ingest, relay and housekeeping on a clock that passes when told to."""

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
        self._ledger = Ledger(self.database)
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
        """Keep many as the broker's bulk does; says of each whether it was taken."""
        outcomes = telemetry.ingest_all(self.context, arrivals, "broker")
        return [not isinstance(outcome, FullError) for outcome in outcomes]

    def send_next(self) -> list[Shipment]:
        """What the relay would hand to its threads now."""
        if wakeup.CHANGED in wakeup.drain(self._wake):
            self._write()
            self._schedule.rewind()
        with self.database.read() as connection:
            streams, self._newest_row = queue.streams_after(connection, self._newest_row)
            self._schedule.announce(streams)
            for stream, after_id, limit in self._schedule.hungry():
                found = queue.heads(connection, stream, after_id, limit)
                self._schedule.feed(stream, found, limit)
        return self._schedule.take(self.passed_s, self.cloud.offer())

    def answered(self, shipment: Shipment, replies: Sequence[Reply]) -> None:
        """Take in what the cloud has said."""
        verdicts = [judge(reply) for reply in replies]
        happenings = self._schedule.settle(shipment, verdicts, self.passed_s)
        for entry in map(Entry, shipment.parcels, happenings, verdicts):
            self._ledger.note(entry, self.passed_s)

    def relay(self) -> bool:
        """One turn of the relay; says whether anything went out."""
        shipments = self.send_next()
        for shipment in shipments:
            self.answered(shipment, self.cloud.send(shipment.parcels))
        self._write()
        return bool(shipments)

    def _write(self) -> None:
        if self._ledger.write(self.passed_s, NOON + self.passed_s):
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
            return records.count_waiting(connection)
