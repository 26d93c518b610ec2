"""Logs of a vehicle whose clock goes back when it is restarted; time is simulated."""

from datetime import timedelta
from pathlib import Path

import pytest

from mavlink_broker.vehicle.recovery_state import RecoveryRecord
from tests.support.log_world import BOOT, World

pytestmark = pytest.mark.usefixtures("_small_parts")


def test_a_flight_after_a_restart_that_set_the_clock_back_has_its_own_log(tmp_path: Path) -> None:
    """The log of the flight before has a time within the new flight."""
    world = World(tmp_path)
    world.wait(300.0)
    first = world.fly(20_000)
    world.run_until(lambda: len(world.archive.sent) == 1)
    second = world.fly(30_000)
    world.run_until(lambda: len(world.archive.sent) == 2)
    world.reboot(clock_back_s=180.0)
    third = world.fly(10_000, seconds=120.0)
    world.run_until(lambda: len(world.archive.sent) == 3)
    world.wait(60.0)
    assert world.archive.sent == [first, second, third]


def test_a_flight_after_such_a_restart_has_no_log_that_was_sent_for_another(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = World(tmp_path)
    world.wait(300.0)
    flights = [world.fly(20_000), world.fly(30_000)]
    world.run_until(lambda: len(world.archive.sent) == 2)
    world.reboot(clock_back_s=180.0)
    world.arm(150.0)
    world.wait(120.0)
    assert world.archive.sent == flights
    assert "its vehicle lists no log of it" in caplog.text


def test_flights_before_and_after_such_a_restart_that_wait_have_their_own_logs(
    tmp_path: Path,
) -> None:
    world = World(tmp_path)
    world.may_fetch = False
    world.wait(300.0)
    flights = [world.fly(20_000)]
    world.reboot(clock_back_s=40.0)
    flights.append(world.fly(30_000))
    world.may_fetch = True
    world.run_until(lambda: len(world.archive.sent) == 2)
    world.wait(120.0)
    assert world.archive.sent == flights


def test_a_log_sent_for_a_flight_after_a_restart_is_not_of_one_before_it(tmp_path: Path) -> None:
    """The vehicle deleted the log of the first flight before it could be fetched."""
    world = World(tmp_path)
    world.may_fetch = False
    world.wait(300.0)
    world.fly(20_000)
    (path,) = (tmp_path / "log").rglob("*.ulg")
    path.unlink()
    world.reboot(clock_back_s=40.0)
    second = world.fly(30_000)
    world.may_fetch = True
    world.wait(300.0)
    assert world.archive.sent == [second]


@pytest.mark.parametrize("is_record_known", [True, False])
def test_a_flight_whose_broker_was_restarted_lasts_since_its_arming(
    tmp_path: Path, *, is_record_known: bool
) -> None:
    """The edge server's flight may have ended with its mission, before the restart."""
    world = World(tmp_path)
    world.wait(10.0)
    contents = world.air.write_log(f"{BOOT + timedelta(seconds=world.air.now_s):%H_%M_%S}", 5000)
    armed_at = world.logs.utc
    world.vehicle.snapshot.armed = True
    armed_s = world.vehicle.snapshot.time_s
    world.wait(60.0)
    world.start_broker()
    world.vehicle.snapshot.armed = True
    world.vehicle.armed_period.update(world.vehicle.observed_mode, world.air.now_s)
    world.wait(5.0)
    if is_record_known:
        world.vehicle.recovery.recall(RecoveryRecord(armed_s=armed_s), world.air.now_s)
    world.wait(15.0)
    world.vehicle.snapshot.armed = False
    world.run_until(lambda: bool(world.archive.sent))
    ((log, _),) = world.archive.logs.values()
    seen_s = 80.0 if is_record_known else 20.0
    assert (log.ended_at - log.started_at).total_seconds() == pytest.approx(seen_s, abs=1.0)
    assert is_record_known is (log.started_at - armed_at < timedelta(seconds=1))
    assert world.archive.sent == [contents]
