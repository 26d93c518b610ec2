"""Three days without a cloud, in simulated time: a bounded disk, and nothing lost in silence.

Vehicles report in bursts, the cloud is away, the disk budget is a small part of what comes in.
When the cloud is back, every alarm, report and observation arrives, and of every other stream each
record either arrives or lies in a gap that was delivered, the counts being the same.
"""

import json
from collections.abc import Iterator
from typing import Final, NamedTuple

from afarcloud.state import Report
from afarcloud.wire import Kind, read
from edge_server.config import Config
from edge_server.outbox.queue import Stream
from edge_server.outbox.uplink import MAXIMUM_BATCH
from edge_server.process.preparation import prepare
from edge_server.services.reports.telemetry import Arrival
from tests.support.virtual_station import VirtualCloud, VirtualStation
from tests.unit.edge_server import documents

HOURS: Final = 72
MIB: Final = 1024 * 1024
VEHICLES: Final = 5
_PROBED_S: Final = 60.0  # Of each hour the relay tries; each try is a commit
_CYCLE: Final = ("state_vector", "pose", "state_vector", "pose", "battery")
_RARE: Final = {"observation": 60, "mission_report": 30, "alarm": 300}
"""Seconds between two of a kind, for each vehicle."""


class Outcome(NamedTuple):
    """What came of it."""

    taken: int
    delivered: int
    declared: int
    gaps: int
    reasons: frozenset[str]
    largest_share: float  # Of the budget, in use at any time


class _Farm:
    """What the vehicles have reported; numbers count each stream from 0."""

    def __init__(self) -> None:
        self._templates: dict[Stream, Report] = {}
        self.taken: dict[Stream, int] = {}

    def second(self, number: int) -> Iterator[Arrival]:
        """Ten records of five vehicles, and the rarer ones when it is their time."""
        for vehicle_id in range(1, VEHICLES + 1):
            for turn in (2 * number, 2 * number + 1):
                yield self._next(_CYCLE[turn % len(_CYCLE)], vehicle_id)
            for kind, every_s in _RARE.items():
                if (number + vehicle_id) % every_s == 0:
                    yield self._next(kind, vehicle_id)

    def _next(self, kind: str, vehicle_id: int) -> Arrival:
        stream = Stream(vehicle_id, kind)
        if stream not in self._templates:
            report = read(Kind(kind), documents.telemetry(kind, 0, vehicle_id))
            assert isinstance(report, Report)
            self._templates[stream] = report
        number = self.taken.get(stream, 0)
        self.taken[stream] = number + 1
        report = self._templates[stream].model_copy(update={"sequence_number": number})
        return Arrival(Kind(kind), report, None)


def run(config: Config, burst_s: int) -> Outcome:
    """Live through the outage; each hour the vehicles report for so many seconds."""
    prepare(config)
    station = VirtualStation(config, VirtualCloud(MAXIMUM_BATCH))
    station.cloud.is_there = False
    farm, largest, second = _Farm(), 0, 0
    for _ in range(HOURS):
        for start in range(0, burst_s, 10):
            arrivals: list[Arrival] = []
            for _ in range(min(10, burst_s - start)):
                arrivals += farm.second(second)
                second += 1
            assert all(station.ingest_all(arrivals))
            station.pass_s(10.0)
            station.context.space.maintain(station.passed_s)
            largest = max(largest, station.context.space.measure().data_bytes)
        station.relay_for(_PROBED_S)
        station.pass_s(max(3600.0 - burst_s - _PROBED_S, 0.0))
    station.cloud.is_there = True
    station.drain()
    station.close()
    return _judge(station, farm, largest / (config.data_budget_mib * MIB))


def _judge(station: VirtualStation, farm: _Farm, largest_share: float) -> Outcome:
    """Compare what was taken with what has arrived; raises AssertionError."""
    arrived: dict[Stream, set[int]] = {stream: set() for stream in farm.taken}
    latest = {}
    for record in station.cloud.kept.values():
        body = json.loads(record.payload)
        if record.stream.kind == "gap":
            latest[body["gap_id"]] = body
            continue
        assert body["sequence_number"] not in arrived[record.stream]
        arrived[record.stream].add(body["sequence_number"])
    gaps, declared = list(latest.values()), 0
    for stream, number in farm.taken.items():
        lost = set(range(number)) - arrived[stream]
        mine = [gap for gap in gaps if gap["stream"] == f"{stream.vehicle_id}/{stream.kind}"]
        covered = set[int]()
        for gap in mine:
            covered |= set(range(gap["from_sequence_number"], gap["to_sequence_number"] + 1))
        assert lost <= covered, f"{stream}: {len(lost - covered)} lost in silence"
        assert sum(gap["count"] for gap in mine) == len(lost), stream
        if stream.kind in _RARE:
            assert not lost, stream
        declared += len(lost)
    assert sum(station.dropped.values()) == declared
    taken = sum(farm.taken.values())
    delivered = sum(len(numbers) for numbers in arrived.values())
    assert delivered + declared == taken
    reasons = frozenset(gap["reason"] for gap in gaps)
    return Outcome(taken, delivered, declared, len(gaps), reasons, largest_share)
