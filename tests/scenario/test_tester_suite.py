"""One suite for the broker on two vehicles that share no code: ours, and the tester on MAVSDK."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

import pytest

from afarcloud.enumerations import AlarmCode, EventType, Status
from sim.fault_schedule import Fault, Kind
from tests.support.broker_world import land, mission, takeoff, waypoint
from tests.support.fake_edge import FakeEdge
from tests.support.flying_world import FlyingWorld
from tests.support.keyboard_world import KeyboardWorld

pytestmark = pytest.mark.scenario

FLIGHT = 1201
HEIGHT_M = 3.0
FINISHED, FAILED, ABORTED = Status.FINISHED, Status.FAILED, Status.ABORTED


class World(Protocol):
    """A vehicle, the broker, and an edge server in memory."""

    edge: FakeEdge

    def run_until(self, condition: Any, within_s: float = ...) -> None: ...

    def run_until_over(self, mission_id: int, within_s: float = ...) -> None: ...

    def run(self, seconds: float) -> None: ...

    def start_broker(self) -> None: ...

    def kill_broker(self) -> None: ...

    @property
    def is_armed(self) -> bool: ...

    def linger_in(self, command: int) -> None:
        """Do not get beyond a command before `go_on`, if that can be had."""

    def go_on(self) -> None:
        """Finish every command from now on."""

    def break_gps(self) -> None:
        """Have the GPS fail."""

    @property
    def missions_taken(self) -> int:
        """How many missions were uploaded."""


class Ours(FlyingWorld):
    """The project's own vehicle in its simulation."""

    def linger_in(self, command: int) -> None:
        """It needs its time anyhow."""

    def go_on(self) -> None:
        """It does."""

    def break_gps(self) -> None:
        now_us = self.autopilot.vehicle.time_us
        self.simulation.add_fault(Fault(kind=Kind.GPS_LOSS, start_us=now_us))

    @property
    def missions_taken(self) -> int:
        return sum(frame.kind == "MISSION_COUNT" for frame in self.air.sent)


class Theirs(KeyboardWorld):
    """MAVSDK's server plugins and a person who types."""

    def linger_in(self, command: int) -> None:
        self.types_until = command

    def go_on(self) -> None:
        self.types_until = None

    def break_gps(self) -> None:
        self.type("3", "1", "5", "0.5", "1.5")

    @property
    def missions_taken(self) -> int:
        return self.uploads


@pytest.fixture(params=["ours", "tester"])
def world(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[World]:
    if request.param == "ours":
        yield Ours(tmp_path)
        return
    with Theirs() as theirs:
        yield theirs


def flight(mission_id: int = FLIGHT, north_m: float = 5.0) -> dict[str, Any]:
    """Up, some metres north, back and down: short, since each test flies it."""
    there = waypoint(north_m=north_m)
    there["parameters"]["altitude"] = HEIGHT_M
    return mission(takeoff(altitude=HEIGHT_M), there, land(), mission_id=mission_id)  # type: ignore[no-any-return]


def is_running(world: World, command: int) -> bool:
    if not world.edge.reports(FLIGHT):
        return False
    return world.edge.statuses(FLIGHT)[command] == Status.RUNNING


def fly_into(world: World, command: int, north_m: float = 5.0) -> None:
    """Fly until a command is reported to run."""
    world.linger_in(command)
    world.edge.plan(flight(north_m=north_m))
    world.run_until(lambda: is_running(world, command))


def outcomes(world: World, event: int) -> list[str]:
    return [word["status"] for word in world.edge.acknowledgements(event)]


def test_a_mission_is_flown_to_its_end(world: World) -> None:
    world.edge.plan(flight())
    world.run_until_over(FLIGHT)
    assert world.edge.status(FLIGHT) == FINISHED
    assert world.edge.statuses(FLIGHT) == [FINISHED] * 3
    assert world.missions_taken == 1
    assert not world.is_armed
    for kind in ("/pose/", "/battery/"):
        assert len(world.edge.bodies(kind)) == 3
    states = [
        [command["command_status_id"] for command in report["command_report_array"]]
        for report in world.edge.reports(FLIGHT)
    ]
    assert all(list(of_one) == sorted(of_one) for of_one in zip(*states, strict=True)), states


def test_an_abort_ends_what_runs_and_brings_the_vehicle_down(world: World) -> None:
    fly_into(world, 1)
    event = world.edge.event(EventType.ABORT_MISSION)
    world.run_until_over(FLIGHT)
    assert world.edge.statuses(FLIGHT) == [FINISHED, ABORTED, ABORTED]
    assert world.edge.status(FLIGHT) == ABORTED
    world.run_until(lambda: outcomes(world, event)[-1:] == ["done"])
    world.run_until(lambda: not world.is_armed)


def test_a_soft_abort_lets_the_running_command_end(world: World) -> None:
    fly_into(world, 1)
    event = world.edge.event(EventType.SOFT_ABORT_MISSION)
    world.run_until(lambda: outcomes(world, event) == ["accepted"])
    world.go_on()
    world.run_until_over(FLIGHT)
    assert world.edge.statuses(FLIGHT) == [FINISHED, FINISHED, ABORTED]
    world.run_until(lambda: outcomes(world, event)[-1:] == ["done"])


def test_a_speed_is_changed_in_flight(world: World) -> None:
    fly_into(world, 1, north_m=40.0)
    event = world.edge.event(EventType.DRONE_SPEED, maximum_speed=3.0)
    world.run_until(lambda: outcomes(world, event)[-1:] == ["done"])
    assert world.edge.status(FLIGHT) == Status.RUNNING


def test_an_alarm_fails_the_mission_and_its_running_command(world: World) -> None:
    fly_into(world, 1, north_m=40.0)
    world.break_gps()
    world.run_until_over(FLIGHT)
    assert world.edge.statuses(FLIGHT) == [FINISHED, FAILED, ABORTED]
    assert world.edge.status(FLIGHT) == FAILED
    alarm = world.edge.bodies("/alarm/")[0]
    assert (alarm["alarm_code_id"], alarm["mission_id"]) == (AlarmCode.EQUIPMENT_GPS, FLIGHT)


def test_a_broker_that_is_restarted_takes_the_flight_up_where_it_is(world: World) -> None:
    fly_into(world, 1)
    world.kill_broker()
    world.run(0.5)
    world.start_broker()
    world.go_on()
    world.run_until_over(FLIGHT)
    assert world.edge.statuses(FLIGHT) == [FINISHED] * 3
    assert world.missions_taken == 1


def test_a_second_mission_waits_for_the_first(world: World) -> None:
    first, second = flight(), flight(FLIGHT + 1)
    world.edge.plan(first)
    world.edge.plan(second)
    world.run_until_over(FLIGHT)
    assert world.edge.status(FLIGHT) == FINISHED
    world.run_until_over(FLIGHT + 1)
    assert world.edge.statuses(FLIGHT + 1) == [FINISHED] * 3
    assert world.missions_taken == 2
