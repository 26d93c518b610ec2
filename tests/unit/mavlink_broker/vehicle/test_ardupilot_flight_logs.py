"""The logs of ArduPilot, which lists an open log with the present time, and closes it when read."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from mavlink_broker.autopilots.families import ARDUPILOT
from mavlink_broker.effects import BeginLog
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.log_download import LogEntry, LogList
from tests.support.ardupilot_logs import ArduPilotLogs
from tests.support.log_air import PART_BYTES, ROUTE
from tests.support.log_world import BOOT, World
from tests.support.lossy_link import Conditions

pytestmark = pytest.mark.usefixtures("_small_parts")

LOSSY = Conditions(loss=0.2, duplication=0.1, reordering=0.2)


class ArduWorld(World):
    """A vehicle of ArduPilot's instead of the project's own."""

    def __init__(
        self,
        folder: Path,
        conditions: Conditions | None = None,
        **habits: Any,
    ) -> None:
        super().__init__(folder)
        self.air: ArduPilotLogs = ArduPilotLogs(  # type: ignore[assignment]  # Another vehicle
            conditions or Conditions(), BOOT.timestamp(), **habits
        )

    def start_broker(self) -> None:
        super().start_broker()
        self.vehicle.autopilot = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        self.vehicle.family = ARDUPILOT

    def fly(self, size: int, *, seconds: float = 60.0) -> bytes:
        self.air.arm()
        self.vehicle.snapshot.armed = True
        self.wait(seconds)
        contents = self.air.write(size)
        self.air.disarm()
        self.vehicle.snapshot.armed = False
        self.run(0.5)
        return contents

    @property
    def begun(self) -> list[BeginLog]:
        return [job.request for job in self.archive.requests if isinstance(job.request, BeginLog)]


def listed(air: ArduPilotLogs) -> tuple[LogEntry, ...]:
    logs = LogList(ROUTE, RoundTrip())
    air.send(logs.start(air.now_s))
    while logs.entries is None:
        for message in air.step():
            logs.receive(message, air.now_s)
        air.send(logs.tick(air.now_s))
    return logs.entries


def test_all_logs_are_listed_although_entries_are_lost() -> None:
    """The end of a repeated request is its last number, not that of the newest log."""
    air = ArduPilotLogs(Conditions(loss=0.3), BOOT.timestamp(), closes_logs=True)
    for size in range(40):
        air.arm()
        air.write(size)
        air.disarm()
        air.step(20.0)
    started_s = air.now_s
    assert [entry.size for entry in listed(air)] == [100 + size for size in range(40)]
    assert air.now_s - started_s < 30.0


@pytest.mark.parametrize("conditions", [Conditions(), LOSSY], ids=["clean", "lossy"])
@pytest.mark.parametrize("logs_disarmed", [False, True], ids=["armed only", "always"])
def test_a_log_that_is_still_open_is_fetched_once(
    tmp_path: Path, conditions: Conditions, *, logs_disarmed: bool
) -> None:
    world = ArduWorld(tmp_path, conditions, logs_disarmed=logs_disarmed)
    contents = world.fly(2 * PART_BYTES)
    world.run_until(lambda: bool(world.archive.sent))
    assert world.archive.sent == [contents]
    assert len({log.name for log in world.begun}) == 1
    (log,) = {log.name: log for log in world.begun}.values()
    flown_until_s = (datetime.fromtimestamp(log.listed_s, UTC) - log.ended_at).total_seconds()
    assert log.format == "bin"
    assert abs(flown_until_s) < 2.0


def test_reading_it_opens_no_further_log(tmp_path: Path) -> None:
    """For 15 s after disarming a vehicle goes on in its log, or in another if that was closed."""
    world = ArduWorld(tmp_path)
    world.fly(1000)
    world.run_until(lambda: bool(world.archive.sent))
    assert len(world.air.files) == 1


def test_each_of_several_flights_has_its_log(tmp_path: Path) -> None:
    world = ArduWorld(tmp_path, logs_disarmed=True)
    flights = []
    for size in (20_000, 30_000, 10_000):
        flights.append(world.fly(size))
        world.run_until(lambda: len(world.archive.sent) == len(flights))
        world.wait(30.0)
    assert world.archive.sent == flights


def test_two_flights_in_a_log_that_nobody_closed_both_have_it(tmp_path: Path) -> None:
    world = ArduWorld(tmp_path)
    world.fly(20_000)
    contents = world.fly(30_000)
    world.run_until(lambda: len(world.archive.sent) == 2)
    assert world.archive.sent == [contents, contents]


@pytest.mark.parametrize("file_clock_s", [-3600.0, 3600.0])
def test_files_with_another_clock_than_the_vehicle_are_found(
    tmp_path: Path, file_clock_s: float
) -> None:
    """A simulation in fast motion dates its files by the clock of its computer."""
    world = ArduWorld(tmp_path, file_clock_s=file_clock_s)
    contents = world.fly(20_000)
    world.run_until(lambda: bool(world.archive.sent))
    assert world.archive.sent == [contents]


@pytest.mark.parametrize("dates_opening", [False, True], ids=["end", "beginning"])
def test_a_log_that_its_vehicle_closes_is_found(tmp_path: Path, *, dates_opening: bool) -> None:
    world = ArduWorld(tmp_path, closes_logs=True, dates_opening=dates_opening)
    flights = []
    for size in (20_000, 30_000):
        flights.append(world.fly(size))
        world.run_until(lambda: len(world.archive.sent) == len(flights))
    assert world.archive.sent == flights


@pytest.mark.parametrize("does", ["broker", "vehicle"])
def test_a_restart_goes_on_where_it_was(tmp_path: Path, does: str) -> None:
    world = ArduWorld(tmp_path)
    contents = world.fly(3 * PART_BYTES)
    world.run_until(lambda: any(len(data) for _, data in world.archive.logs.values()))
    restart: Callable[[], None] = world.start_broker if does == "broker" else world.logs.restarted
    restart()
    world.run_until(lambda: bool(world.archive.sent))
    assert world.archive.sent == [contents]
    assert len({log.name for log in world.begun}) == 1


def test_a_vehicle_whose_card_is_empty_is_left_alone(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = ArduWorld(tmp_path)
    world.fly(1000)
    world.air.files.clear()
    world.wait(120.0)
    assert "its vehicle lists no log of it" in caplog.text
    assert world.archive.logs == {}
