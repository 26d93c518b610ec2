"""The logs of flights, fetched from PX4's log server in the versions that its vehicles run.

Time is simulated. A vehicle's clock says nine o'clock at 0 s of the broker's.
"""

import random
from collections.abc import Callable
from datetime import timedelta
from itertools import count

import pytest

from mavlink_broker.autopilots.families import PX4
from mavlink_broker.effects import Effects, LogJob
from mavlink_broker.mavlink.dialect import Route
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.log_download import LogEntry, LogList
from mavlink_broker.vehicle.flight_logs import FlightLogs
from mavlink_broker.vehicle.vehicle import Vehicle
from tests.support.log_air import PART_BYTES
from tests.support.log_world import BOOT, Archive
from tests.support.px4_logs import Px4Logs, Px4Logs114, Px4Logs116, StoredLog

pytestmark = pytest.mark.usefixtures("_small_parts")

ROUTE = Route(own_system=254, own_component=191, target_system=1, target_component=1)
BOOT_S = round(BOOT.timestamp())
STEP_S = 0.05
WRITES_FOR_S = 2
"""A log is closed so long after the disarming."""
VERSIONS = pytest.mark.parametrize("version", [Px4Logs114, Px4Logs116])


class World:
    """A PX4, the part of the broker that fetches its logs, and what the edge server has of them."""

    def __init__(self, version: Callable[[], Px4Logs]) -> None:
        self.px4 = version()
        self.archive = Archive()
        self.now_s = 0.0
        self._vehicle = Vehicle(1, ROUTE, family=PX4)
        self._vehicle.snapshot.booted_at_utc_s = BOOT_S
        self._vehicle.snapshot.armed = False
        names = (f"log-{number}" for number in count(1))
        self._logs = FlightLogs(
            self._vehicle, lambda: next(names), limit_bytes=2**24, limit_s=600.0
        )
        self._jobs: list[LogJob] = []

    def fly(self, size: int, at: int | None = None) -> bytes:
        """Fly for a minute; gives the log, which takes the place `at` in its directory."""
        contents = random.Random(size).randbytes(size)
        self._vehicle.snapshot.armed = True
        self.run(60.0)
        self._vehicle.snapshot.armed = False
        log = StoredLog(BOOT_S + round(self.now_s) + WRITES_FOR_S, contents)
        self.px4.card.insert(len(self.px4.card) if at is None else at, log)
        self.run(1.0)
        return contents

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.step()

    def run_until(self, is_done: Callable[[], bool]) -> None:
        end = self.now_s + 300.0
        while not is_done():
            assert self.now_s < end
            self.step()

    def step(self) -> None:
        self.now_s += STEP_S
        effects = Effects()
        for message in self.px4.send(40):
            self._logs.receive(message, self.now_s, effects)
        self._vehicle.snapshot.time_s = self.now_s
        self._logs.utc = BOOT + timedelta(seconds=self.now_s)
        for job in self._jobs:
            self._logs.take_outcome(self.archive.carry_out(job), self.now_s, effects)
        may_fetch = self._vehicle.snapshot.armed is False
        self._logs.step(self.now_s, effects, may_fetch=may_fetch)
        self._jobs = [job for job in effects.jobs if isinstance(job, LogJob)]
        for message in effects.messages:
            self.px4.receive(message)


@VERSIONS
def test_each_flight_has_its_own_log_though_px4_lists_when_logs_end(
    version: Callable[[], Px4Logs],
) -> None:
    world = World(version)
    world.px4.card.append(StoredLog(BOOT_S - 86_400, b"of yesterday"))
    flights = [world.fly(30_000), world.fly(PART_BYTES + 7), world.fly(20_000)]
    world.run_until(lambda: len(world.archive.sent) == 3)
    assert world.archive.sent == flights


@VERSIONS
def test_the_first_log_on_an_empty_card_is_fetched(version: Callable[[], Px4Logs]) -> None:
    world = World(version)
    contents = world.fly(1000)
    world.run_until(lambda: bool(world.archive.sent))
    assert world.archive.sent == [contents]


@VERSIONS
def test_a_log_whose_number_an_interrupted_one_had_is_opened_anew(
    version: Callable[[], Px4Logs],
) -> None:
    world = World(version)
    first = world.fly(3 * PART_BYTES)
    world.run_until(lambda: any(len(data) for _, data in world.archive.logs.values()))
    second = world.fly(PART_BYTES, at=0)
    world.run_until(lambda: len(world.archive.sent) == 2)
    assert world.archive.sent == [first, second]


@VERSIONS
@pytest.mark.parametrize("seed", range(8))
def test_a_list_with_lost_entries_is_complete_in_the_end(
    version: Callable[[], Px4Logs], seed: int
) -> None:
    chance, px4 = random.Random(seed), version()
    px4.card = [StoredLog(BOOT_S + 60 * number, bytes(number)) for number in range(12)]
    logs, now = LogList(ROUTE, RoundTrip()), 0.0
    for request in logs.start(now):
        px4.receive(request)
    while logs.entries is None:
        now += STEP_S
        for message in px4.send(3):
            if chance.random() > 0.3:
                logs.receive(message, now)
        for request in logs.tick(now):
            px4.receive(request)
    assert logs.entries == tuple(
        LogEntry(number, log.changed_s, len(log.contents)) for number, log in enumerate(px4.card)
    )
    assert now < 15.0
