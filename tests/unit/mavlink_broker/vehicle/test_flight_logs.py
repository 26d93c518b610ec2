"""The logs of a vehicle, fetched from its real log server and sent to an edge server in memory.

Time is simulated. A vehicle's clock says noon at 1000 s of the broker's.
"""

import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from itertools import count
from pathlib import Path

import pytest

from mavlink_broker.effects import (
    BeginLog,
    DropLog,
    Effects,
    FindLogs,
    LogJob,
    LogJobDone,
    LogJobFailed,
    LogJobOutcome,
    LogState,
    SendLogPart,
)
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.vehicle.flight_logs import FlightLogs
from mavlink_broker.vehicle.logged_flight import MAX_FAILURES, MAX_FLIGHTS
from mavlink_broker.vehicle.vehicle import Vehicle
from tests.support.log_air import PART_BYTES, ROUTE, LogAir
from tests.support.lossy_link import Conditions

pytestmark = pytest.mark.usefixtures("_small_parts")

BOOT = datetime(2026, 3, 1, 9, 0, tzinfo=UTC)
LIMIT_BYTES = 2_000_000
BUSY_STEP_S, IDLE_STEP_S = 0.004, 0.04
BUSY_S = 0.1
"""Time that passes in short steps after anything about logs was sent or received."""
GONE = Conditions(loss=1.0)


class Archive:
    """What an edge server has of the logs of one vehicle."""

    def __init__(self) -> None:
        self.logs: dict[str, tuple[BeginLog, bytearray]] = {}
        self.complete: set[str] = set()
        self.refusal: Callable[[LogJob], LogJobOutcome | None] = lambda _: None
        self.requests: list[LogJob] = []

    def carry_out(self, job: LogJob) -> LogJobOutcome:
        self.requests.append(job)
        if (refused := self.refusal(job)) is not None:
            return refused
        match job.request:
            case FindLogs():
                states = (self._state(name) for name in self.logs if name not in self.complete)
                return LogJobDone(job.number, tuple(states))
            case BeginLog(name=name) as log:
                assert self.logs.setdefault(name, (log, bytearray()))[0] == log
                return LogJobDone(job.number, (self._state(name),))
            case SendLogPart(name, offset, data, is_last):
                if offset != len(self.logs[name][1]) or name in self.complete:
                    return LogJobFailed(job.number, "HTTP 409", is_final=False)
                self.logs[name][1].extend(data)
                self.complete |= {name} if is_last else set()
                return LogJobDone(job.number, (self._state(name),))
            case DropLog(name):
                self.logs.pop(name, None)
                return LogJobDone(job.number)

    def _state(self, name: str) -> LogState:
        log, data = self.logs[name]
        return LogState(log, len(data), is_complete=name in self.complete)

    @property
    def sent(self) -> list[bytes]:
        """The complete logs in the order of their flights."""
        logs = sorted(
            (self.logs[name] for name in self.complete), key=lambda one: one[0].started_at
        )
        return [bytes(data) for _, data in logs]


class World:
    """A vehicle with logs, the broker's part that fetches them, and an edge server."""

    def __init__(self, folder: Path, conditions: Conditions | None = None) -> None:
        self.air = LogAir(folder, conditions or Conditions())
        self.archive = Archive()
        self.asked: list[str] = []
        self.names = (f"log-{number}" for number in count(1))
        self.may_fetch = True
        self.is_answering = True
        self._waiting: list[LogJob] = []
        self._busy_until = 0.0
        self.limit_s = 600.0
        self.booted_s = 0.0
        self.clock_back_s = 0.0
        """How much the vehicle's clock is behind that of the broker."""
        self.start_broker()

    def start_broker(self) -> None:
        """Begin with an empty memory."""
        self.vehicle = Vehicle(1, ROUTE)
        self.vehicle.snapshot.booted_at_utc_s = BOOT.timestamp()
        self.vehicle.snapshot.armed = False
        self.logs = FlightLogs(
            self.vehicle,
            lambda: next(self.names),
            limit_bytes=LIMIT_BYTES,
            limit_s=self.limit_s,
        )
        self._waiting.clear()

    def fly(self, size: int, *, seconds: float = 60.0) -> bytes:
        """Fly for a while; gives what the vehicle logs of it."""
        began = BOOT + timedelta(seconds=self.air.now_s - self.clock_back_s)
        contents = self.air.write_log(f"{began:%H_%M_%S}", size, seed=size)
        self.arm(seconds)
        return contents

    def reboot(self, clock_back_s: float = 0.0) -> None:
        """Restart the vehicle, whose clock then goes back."""
        self.air.reboot()
        self.clock_back_s += clock_back_s
        booted = BOOT + timedelta(seconds=self.air.now_s - self.clock_back_s)
        self.vehicle.snapshot.booted_at_utc_s = booted.timestamp()
        self.booted_s = self.air.now_s
        self.logs.restarted()

    def arm(self, seconds: float) -> None:
        """Be armed for a while."""
        self.vehicle.snapshot.armed = True
        self.wait(seconds)
        self.vehicle.snapshot.armed = False
        self.run(0.5)

    def run(self, seconds: float, step_s: float | None = None) -> None:
        end = self.air.now_s + seconds
        while self.air.now_s < end:
            self.step(step_s)

    def wait(self, seconds: float) -> None:
        """Let time pass in which nothing hangs on milliseconds."""
        self.run(seconds, 0.2)

    def run_until(self, is_done: Callable[[], bool], within_s: float = 600.0) -> None:
        end = self.air.now_s + within_s
        while not is_done():
            assert self.air.now_s < end
            self.step()

    def step(self, step_s: float | None = None) -> None:
        if step_s is None:
            step_s = BUSY_STEP_S if self.air.now_s < self._busy_until else IDLE_STEP_S
        effects = Effects()
        arrived = self.air.step(step_s)
        for message in arrived:
            self.logs.receive(message, self.air.now_s, effects)
        snapshot = self.vehicle.snapshot
        snapshot.time_s = self.air.now_s - self.booted_s
        self.logs.utc = BOOT + timedelta(seconds=self.air.now_s)
        if self.is_answering:
            for job in self._waiting:
                self.logs.take_outcome(self.archive.carry_out(job), self.air.now_s, effects)
            self._waiting.clear()
        may_fetch = self.may_fetch and snapshot.armed is False
        self.logs.step(self.air.now_s, effects, may_fetch=may_fetch)
        self._waiting += [job for job in effects.jobs if isinstance(job, LogJob)]
        self._send(effects.messages)
        if effects.messages or any(one.get_type().startswith("LOG_") for one in arrived):
            self._busy_until = self.air.now_s + BUSY_S

    def _send(self, messages: list[Message]) -> None:
        assert not (messages and self.vehicle.snapshot.armed) or {
            message.get_type() for message in messages
        } == {"LOG_REQUEST_END"}
        self.asked += [message.get_type() for message in messages]
        self.air.send(messages)


def test_the_log_of_a_flight_is_sent_after_the_landing(tmp_path: Path) -> None:
    world = World(tmp_path)
    contents = world.fly(2 * PART_BYTES + 1000)
    assert world.archive.logs == {}
    world.run_until(lambda: bool(world.archive.sent))
    assert world.archive.sent == [contents]
    ((log, _),) = world.archive.logs.values()
    assert (log.ended_at - log.started_at) == pytest.approx(timedelta(seconds=60), abs=timedelta(1))
    assert datetime.fromtimestamp(log.listed_s, UTC) - log.started_at < timedelta(seconds=1)
    sizes = [
        len(job.request.data)
        for job in world.archive.requests
        if isinstance(job.request, SendLogPart)
    ]
    assert sizes == [PART_BYTES, PART_BYTES, 1000]
    assert world.asked[-1] == "LOG_REQUEST_END"
    requests = len(world.asked)
    world.wait(120.0)
    assert len(world.asked) == requests


@pytest.mark.parametrize(
    "conditions",
    [Conditions(loss=0.2, duplication=0.2, reordering=0.2), Conditions(delay_us=600_000, loss=0.1)],
)
def test_each_of_several_flights_has_its_log_over_a_bad_link(
    tmp_path: Path, conditions: Conditions
) -> None:
    world = World(tmp_path, conditions)
    flights = [world.fly(size) for size in (20_000, 30_000, 10_000)]
    world.run_until(lambda: len(world.archive.sent) == 3, 1200.0)
    assert world.archive.sent == flights


def test_a_new_flight_interrupts_at_once_and_the_log_goes_on_behind_it(tmp_path: Path) -> None:
    world = World(tmp_path)
    first = world.fly(3 * PART_BYTES)
    world.run_until(lambda: any(len(data) for _, data in world.archive.logs.values()))
    second = world.fly(1000)
    assert "LOG_REQUEST_END" in world.asked
    world.run_until(lambda: len(world.archive.sent) == 2)
    assert world.archive.sent == [first, second]
    parts = [
        job.request.offset
        for job in world.archive.requests
        if isinstance(job.request, SendLogPart) and job.request.data[:9] != second[:9]
    ]
    assert parts == [0, PART_BYTES, 2 * PART_BYTES]  # None was sent twice


def test_a_mission_interrupts_a_part_that_is_being_sent(tmp_path: Path) -> None:
    world = World(tmp_path)
    contents = world.fly(2 * PART_BYTES)
    world.run_until(lambda: any(isinstance(one.request, BeginLog) for one in world._waiting))
    world.is_answering = False
    world.run_until(lambda: bool(world._waiting))
    world.may_fetch = False
    world.run(10.0)
    world.is_answering = True
    requests = world.air.requests
    world.run(10.0)
    assert world.air.requests == requests
    world.may_fetch = True
    world.run_until(lambda: bool(world.archive.sent))
    assert world.archive.sent == [contents]


def test_a_restarted_broker_goes_on_where_it_was(tmp_path: Path) -> None:
    world = World(tmp_path)
    contents = world.fly(3 * PART_BYTES)
    world.run_until(lambda: any(len(data) for _, data in world.archive.logs.values()))
    world.start_broker()
    world.run_until(lambda: bool(world.archive.sent))
    assert world.archive.sent == [contents]
    begun = [one for one in world.archive.requests if isinstance(one.request, SendLogPart)]
    assert len(begun) == 3


def test_a_broker_that_starts_in_flight_finds_the_log_behind_newer_ones(tmp_path: Path) -> None:
    """It sees that the vehicle is armed before it knows the vehicle's clock."""
    world = World(tmp_path)
    world.may_fetch = False
    began = BOOT + timedelta(seconds=world.air.now_s)
    first = world.air.write_log(f"{began:%H_%M_%S}", 1000, seed=1)
    world.vehicle.snapshot.booted_at_utc_s = None
    world.vehicle.snapshot.armed = True
    world.run(1.0)
    world.vehicle.snapshot.booted_at_utc_s = BOOT.timestamp()
    world.arm(60.0)
    second = world.fly(2000)
    world.may_fetch = True
    world.run_until(lambda: len(world.archive.sent) == 2)
    assert world.archive.sent == [first, second]


def test_a_log_that_a_killed_broker_has_just_begun_is_sent_by_the_next_one(
    tmp_path: Path,
) -> None:
    """Its request is carried out behind the question of the next run."""
    world = World(tmp_path)
    contents = world.fly(3 * PART_BYTES)
    world.run_until(lambda: bool(world.archive.logs))
    late, world.archive.logs = world.archive.logs, {}
    world.start_broker()
    world.run(5.0)
    world.archive.logs.update(late)
    world.run_until(lambda: bool(world.archive.sent))
    assert world.archive.sent == [contents]


@pytest.mark.parametrize("is_temporary", [False, True])
def test_an_edge_server_that_fails_when_it_is_asked_is_asked_again(
    tmp_path: Path, *, is_temporary: bool
) -> None:
    world = World(tmp_path)
    contents = world.fly(3 * PART_BYTES)
    world.run_until(lambda: bool(world.archive.logs))
    world.start_broker()
    world.archive.refusal = lambda job: LogJobFailed(
        job.number, "HTTP 502", is_final=False, is_temporary=is_temporary
    )
    world.run(5.0)
    world.archive.refusal = lambda _: None
    world.wait(590.0)
    world.run_until(lambda: bool(world.archive.sent))
    assert world.archive.sent == [contents]


def test_a_log_that_was_given_up_does_not_stay_though_its_deletion_was_lost(
    tmp_path: Path,
) -> None:
    world = World(tmp_path)
    world.archive.refusal = lambda job: (
        LogJobFailed(job.number, "HTTP 500", is_final=isinstance(job.request, SendLogPart))
        if isinstance(job.request, SendLogPart | DropLog)
        else None
    )
    world.fly(1000)
    world.run_until(lambda: any(isinstance(j.request, SendLogPart) for j in world.archive.requests))
    world.run(5.0)
    assert world.archive.logs
    requests = world.air.requests
    world.archive.refusal = lambda _: None
    world.wait(700.0)
    assert not world.archive.logs
    assert world.air.requests == requests


def test_a_restarted_vehicle_is_asked_again(tmp_path: Path) -> None:
    world = World(tmp_path)
    contents = world.fly(3 * PART_BYTES)
    world.run_until(lambda: any(len(data) for _, data in world.archive.logs.values()))
    world.air.reboot()
    world.logs.restarted()
    world.run_until(lambda: bool(world.archive.sent))
    assert world.archive.sent == [contents]


def test_a_log_is_awaited_while_it_grows(tmp_path: Path) -> None:
    world = World(tmp_path)
    world.fly(5000)
    (path,) = (tmp_path / "log").rglob("*.ulg")
    for _ in range(3):
        with path.open("ab") as log:
            log.write(b"the end comes late")
        world.run(2.0)
    world.run_until(lambda: bool(world.archive.sent))
    assert world.archive.sent == [path.read_bytes()]


def test_two_flights_within_one_log_both_have_it(tmp_path: Path) -> None:
    world = World(tmp_path)
    contents = world.fly(20_000)
    world.arm(60.0)
    world.run_until(lambda: len(world.archive.sent) == 2)
    assert world.archive.sent == [contents, contents]


def test_a_flight_without_a_log_of_its_own_has_none(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = World(tmp_path)
    contents = world.fly(20_000)
    world.run_until(lambda: bool(world.archive.sent))
    world.arm(60.0)
    world.wait(60.0)
    assert world.archive.sent == [contents]
    assert "its vehicle lists no log of it" in caplog.text


def test_a_vehicle_without_log_protocol_is_left_alone(tmp_path: Path) -> None:
    world = World(tmp_path, GONE)
    for _ in range(4):
        world.fly(100)
        world.wait(60.0)
    assert 2 <= len(world.asked) <= 20
    world.logs.restarted()
    requests = len(world.asked)
    world.fly(100)
    world.wait(60.0)
    assert len(world.asked) > requests


def test_a_log_beyond_the_limit_is_not_fetched(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = World(tmp_path)
    world.fly(LIMIT_BYTES + 1)
    world.wait(60.0)
    assert (world.archive.logs, world.air.requests) == ({}, 0)
    assert re.search(r"from 09:00:00 to 09:01:00 is given up: it has 2\.0 MB", caplog.text)


def test_a_log_that_would_take_too_long_is_given_up_soon(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = World(tmp_path, Conditions(delay_us=400_000, loss=0.3))
    world.limit_s = 60.0
    world.start_broker()
    world.fly(LIMIT_BYTES)
    landed_s = world.air.now_s
    world.run_until(lambda: "is given up" in caplog.text)
    assert "over this link" in caplog.text
    assert world.air.now_s - landed_s < 40.0
    world.run(1.0)
    assert world.archive.logs == {}
    assert world.asked[-1] == "LOG_REQUEST_END"


def test_a_log_that_the_edge_server_does_not_want_is_given_up(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = World(tmp_path)
    world.archive.refusal = lambda job: (
        LogJobFailed(job.number, "HTTP 413 too large", is_final=True)
        if isinstance(job.request, BeginLog)
        else None
    )
    world.fly(1000)
    world.wait(300.0)
    assert caplog.text.count("HTTP 413 too large") == 1
    assert world.air.requests == 0


def test_a_fault_of_the_edge_server_is_retried_a_few_times(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = World(tmp_path)
    world.archive.refusal = lambda job: (
        LogJobFailed(job.number, "HTTP 404 no flight", is_final=False)
        if isinstance(job.request, BeginLog)
        else None
    )
    world.fly(1000)
    world.wait(2000.0)
    begun = [one for one in world.archive.requests if isinstance(one.request, BeginLog)]
    assert len(begun) == MAX_FAILURES
    assert caplog.text.count("HTTP 404 no flight") == 1


def test_an_edge_server_that_is_away_is_waited_for(tmp_path: Path) -> None:
    world = World(tmp_path)
    away = LogJobFailed(0, "no answer", is_final=False, is_temporary=True)
    world.archive.refusal = lambda job: LogJobFailed(job.number, *_tail(away))
    contents = world.fly(PART_BYTES + 1)
    world.wait(1800.0)
    assert len(world.archive.requests) < 100
    world.archive.refusal = lambda _: None
    world.run_until(lambda: bool(world.archive.sent), 1300.0)
    assert world.archive.sent == [contents]


def _tail(outcome: LogJobFailed) -> tuple[str, bool, bool]:
    return outcome.reason, outcome.is_final, outcome.is_temporary


def test_logs_that_were_numbered_again_are_not_mixed(tmp_path: Path) -> None:
    world = World(tmp_path)
    world.air.write_log("08_00_00", 3 * PART_BYTES, seed=9)
    contents = world.fly(3 * PART_BYTES)
    world.run_until(lambda: any(len(data) for _, data in world.archive.logs.values()))
    (tmp_path / "log/2026-03-01/08_00_00.ulg").unlink()
    world.air.write_log("23_00_00", 3 * PART_BYTES, seed=10)
    world.air.send([mavlink.MAVLink_log_request_list_message(ROUTE.target_system, 1, 0, 0xFFFF)])
    world.run_until(lambda: bool(world.archive.sent))
    assert world.archive.sent == [contents]
    assert len(world.archive.logs) == 1  # What was mixed is deleted


def test_the_oldest_flights_are_forgotten_when_many_wait(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = World(tmp_path)
    world.may_fetch = False
    flights = [world.fly(1000 + number, seconds=20.0) for number in range(MAX_FLIGHTS + 2)]
    assert caplog.text.count("too many wait") == 2
    world.may_fetch = True
    world.run_until(lambda: len(world.archive.sent) == MAX_FLIGHTS)
    assert world.archive.sent == flights[2:]


def test_nothing_is_fetched_when_the_limit_is_0(tmp_path: Path) -> None:
    world = World(tmp_path)
    world.logs = FlightLogs(world.vehicle, lambda: "x", limit_bytes=0, limit_s=1.0)
    world.fly(1000)
    world.wait(60.0)
    assert (world.asked, world.archive.requests) == ([], [])
