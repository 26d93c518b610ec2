"""The logs of a vehicle, fetched from its real log server and sent to an edge server in memory.

Time is simulated. A vehicle's clock says noon at 1000 s of the broker's.
"""

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from mavlink_broker.effects import BeginLog, DropLog, LogJobFailed, SendLogPart
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.vehicle.flight_logs import FlightLogs
from mavlink_broker.vehicle.logged_flight import MAX_FAILURES, MAX_FLIGHTS
from tests.support.log_air import PART_BYTES, ROUTE
from tests.support.log_world import BOOT, LIMIT_BYTES, World
from tests.support.lossy_link import Conditions

pytestmark = pytest.mark.usefixtures("_small_parts")

GONE = Conditions(loss=1.0)


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
