"""`fly`: a plan without an edge server, on scripted vehicles in simulated time."""

import base64
import dataclasses
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from afarcloud import wire
from afarcloud.enumerations import EventType, Status
from mavlink_broker.app import App
from mavlink_broker.cli.fly import JsonPrinter, PlanFlight, ProgressPrinter
from mavlink_broker.cli.local_edge import LocalEdge
from mavlink_broker.cli.program import Signals, UsageError
from mavlink_broker.config import Config
from mavlink_broker.edge.outbox import Post, Urgency
from mavlink_broker.links.url import Address
from tests.support.broker_world import (
    TICK_S,
    World,
    first_flight,
    go_home,
    mission,
    takeoff,
    waypoint,
)
from tests.support.link_ends import fly_over_udp
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import PX4, Script

ROOT = Path(__file__).parents[4]
PNG = b"\x89PNG\r\n\x1a\n"


class Interrupts(Signals):
    """Signals that a test raises."""

    def __init__(self) -> None:
        self.count = 0
        self.status = 130


class Field:
    """Vehicles in simulated time, which goes on whenever the broker listens."""

    def __init__(self, *documents: dict[str, Any], config: Config | None = None) -> None:
        self.world = World(config=config)
        self.lines: list[str] = []
        self.signals = Interrupts()
        self.interrupt_at: float | None = None
        self.missions = wire.read_plan(json.dumps({"missions": documents}).encode()).missions
        self.edge = LocalEdge(self.missions, ProgressPrinter(self.missions, self.lines.append).take)
        settings = self.world.config
        app = App(settings, self, self.edge, self.world.clock, self.world.new_ulid)
        self.plan_flight = PlanFlight(app, self.edge, self.missions, settings)

    def receive(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        del timeout_s
        self.world.clock.now += TICK_S
        self.world.air.step()
        if self.interrupt_at is not None and self.world.clock.now >= self.interrupt_at:
            self.signals.count, self.interrupt_at = self.signals.count + 1, None
        return self.world.air.receive(0.0)

    def send(self, address: Address, frame: bytes) -> None:
        self.world.air.send(address, frame)

    def radio_status(self, address: Address, free_percent: int) -> None:
        """Nothing fills up here."""

    def contact_addresses(self) -> list[Address]:
        return []

    def wait_for_vehicles(self, within_s: float = 30.0) -> None:
        self.plan_flight.wait_for_vehicles(self.world.clock, self.signals, within_s)

    def fly(self, on_interrupt: EventType | None = None) -> None:
        self.plan_flight.fly(self.world.clock, self.signals, on_interrupt)


def test_a_plan_is_flown_to_its_end_and_printed_step_by_step() -> None:
    field = Field(first_flight())
    field.world.add_vehicle()
    field.wait_for_vehicles()
    field.fly()
    assert field.edge.all_finished
    printed = [line for line in field.lines if line.startswith("mission 1201")]
    assert printed[0] == "mission 1201, command 1 NAV_TAKEOFF: RUNNING"
    assert printed[1] == "mission 1201: RUNNING"
    assert printed[-2:] == ["mission 1201, command 3 NAV_HOME: FINISHED", "mission 1201: FINISHED"]
    assert len(printed) == len(set(printed))


def test_vehicles_of_several_families_fly_at_once() -> None:
    field = Field(first_flight(), first_flight(1202, 2))
    field.world.add_vehicle(1)
    other = field.world.add_vehicle(2, Script(autopilot=0))
    field.wait_for_vehicles()
    field.fly()
    assert field.edge.all_finished
    assert other.uploads == 1


def test_a_vehicle_that_is_not_there_is_named_after_a_while() -> None:
    field = Field(first_flight(), first_flight(1202, 9), config=Config(vehicle_of_system={4: 9}))
    field.world.add_vehicle(1)
    with pytest.raises(
        UsageError, match=r"5 s: vehicle 9 \(system 4\); connected systems: 1"
    ) as late:
        field.wait_for_vehicles(5.0)
    assert late.value.status == 1
    assert field.world.only_vehicle.uploads == 0


def test_what_a_vehicle_refuses_fails_the_plan_with_the_reason() -> None:
    field = Field(first_flight())
    field.world.add_vehicle(script=dataclasses.replace(PX4, refused_item=3))
    field.wait_for_vehicles()
    field.fly()
    assert field.edge.statuses == {1201: Status.FAILED}
    assert any("mission 1201: FAILED (" in line for line in field.lines)


def test_what_cannot_be_flown_ends_before_take_off() -> None:
    nowhere = {"command_id": 3, "command_type_id": 8, "parameters": takeoff()["parameters"]}
    field = Field(mission(takeoff(1), go_home(2), nowhere))
    vehicle = field.world.add_vehicle()
    field.wait_for_vehicles()
    field.fly()
    assert field.edge.statuses == {1201: Status.FAILED}
    assert not vehicle.uploads
    assert any("command 3 NAV_FOLLOW_TARGET: FAILED" in line for line in field.lines)


def test_a_vehicle_that_is_still_armed_is_printed() -> None:
    field = Field(mission(takeoff(), waypoint()))
    field.world.add_vehicle()
    field.wait_for_vehicles()
    assert list(field.plan_flight.armed_vehicles) == []
    field.fly()
    assert field.edge.all_finished
    assert list(field.plan_flight.armed_vehicles) == [
        "vehicle 1 is still armed, in mode AUTO.MISSION"
    ]


class TestAnInterruption:
    def test_leaves_the_vehicle_in_its_mission_unless_printed_otherwise(self) -> None:
        field, vehicle = interrupted(None)
        assert field.edge.statuses == {1201: Status.RUNNING}
        assert vehicle.armed
        assert vehicle.in_mission

    @pytest.mark.first_case
    @pytest.mark.parametrize("kind", [EventType.ABORT_MISSION, EventType.SOFT_ABORT_MISSION])
    def test_brings_it_down_where_that_is_asked_for(self, kind: EventType) -> None:
        field, vehicle = interrupted(kind)
        assert field.edge.statuses == {1201: Status.ABORTED}
        assert not vehicle.in_mission

    def test_of_an_interruption_quits(self) -> None:
        field = Field(first_flight())
        vehicle = field.world.add_vehicle(script=dataclasses.replace(PX4, item_time_s=20.0))
        field.wait_for_vehicles()
        field.signals.count = 2
        field.fly(EventType.ABORT_MISSION)
        assert not field.edge.is_over
        assert vehicle.uploads == 0


def interrupted(kind: EventType | None) -> tuple[Field, Any]:
    field = Field(first_flight())
    vehicle = field.world.add_vehicle(script=dataclasses.replace(PX4, item_time_s=20.0))
    field.wait_for_vehicles()
    field.interrupt_at = field.world.clock.now + 30.0
    field.fly(kind)
    return field, vehicle


class TestTheLocalEdge:
    def test_saves_pictures_under_their_names(self, tmp_path: Path) -> None:
        edge = LocalEdge((), lambda *_: None, folder=tmp_path)
        edge.post(picture("north_0001.png"))
        edge.post(picture(".."))
        folder = tmp_path / "vehicle-1"
        assert (folder / "north_0001.png").read_bytes() == PNG
        assert (folder / "4.png").read_bytes() == PNG

    def test_outlives_a_folder_that_takes_no_pictures(self, tmp_path: Path) -> None:
        nowhere = tmp_path / "file"
        nowhere.write_bytes(b"")
        printed: list[str] = []
        edge = LocalEdge((), lambda kind, _: printed.append(kind), folder=nowhere)
        edge.post(picture("north_0001.png"))
        assert printed == ["image"]

    def test_hands_out_fence_and_rally_points_of_the_plan_with_every_mission(self) -> None:
        fence = {"inclusion": [[[40.0, -4.0], [41.0, -4.0], [41.0, -3.0]]], "max_altitude": 60.0}
        point = {"latitude": 40.1, "longitude": -3.9, "altitude": 20.0}
        document = {
            "missions": [first_flight(), first_flight(1202, 2)],
            "geofence": fence,
            "rally_points": [point],
        }
        plan = wire.read_plan(json.dumps(document).encode())
        edge = LocalEdge(
            plan.missions,
            lambda *_: None,
            geofence=plan.geofence,
            rally_points=plan.rally_points,
        )
        edge.dispatch()
        work = edge.take_work()
        assert [each["geofence"]["max_altitude"] for each in work] == [60.0, 60.0]
        assert [each["rally_points"] for each in work] == [[point], [point]]

    def test_prints_every_report_in_its_envelope(self) -> None:
        lines: list[str] = []
        edge = LocalEdge((), JsonPrinter(lines.append).take)
        edge.post(picture("one.png"))
        assert json.loads(lines[0])["image"]["name"] == "one.png"


def picture(name: str) -> Post:
    body = {
        "sequence_number": 4,
        "vehicle_id": 1,
        "format": "png",
        "image_size": len(PNG),
        "name": name,
        "frame": base64.b64encode(PNG).decode(),
    }
    return Post(
        method="POST",
        path="/image/",
        body=body,
        vehicle_id=1,
        lane="image",
        urgency=Urgency.RESULT,
    )


class TestTheProgram:
    """With real sockets and processes."""

    @pytest.mark.thorough
    def test_flies_a_plan_and_ends_with_status_0(self, tmp_path: Path) -> None:
        with started(tmp_path, "--json") as (process, port):
            vehicle = scripted(item_time_s=0.05)
            fly_over_udp(vehicle, port, lambda: process.poll() is not None)
            out, _ = process.communicate()
        assert process.returncode == 0
        last = [json.loads(line) for line in out.splitlines() if "mission_report" in line][-1]
        assert last["mission_report"]["mission_status_id"] == Status.FINISHED

    @pytest.mark.thorough
    def test_flies_on_when_its_reader_goes_away(self, tmp_path: Path) -> None:
        with started(tmp_path, "--json") as (process, port):
            assert process.stdout is not None
            process.stdout.close()
            fly_over_udp(scripted(item_time_s=0.05), port, lambda: process.poll() is not None)
            assert process.wait() == 0

    @pytest.mark.thorough
    def test_that_cannot_keep_pictures_does_not_begin(self, tmp_path: Path) -> None:
        with started(tmp_path, "--out", "/dev/null/pictures") as (process, _):
            _, errors = process.communicate()
        assert process.returncode == 2
        assert errors == "mavlink_broker: --out /dev/null/pictures: Not a directory\n"

    @pytest.mark.thorough
    def test_that_is_interrupted_prints_what_it_leaves(self, tmp_path: Path) -> None:
        with started(tmp_path) as (process, port):
            vehicle = scripted(item_time_s=60.0)
            fly_over_udp(vehicle, port, lambda: vehicle.airborne)
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=20)
        assert process.returncode == 130
        assert "vehicle 1 was left in mission 1201" in errors


def scripted(item_time_s: float) -> ScriptedVehicle:
    script = dataclasses.replace(PX4, item_time_s=item_time_s)
    return ScriptedVehicle(1, script, booted_at=time.monotonic())


@contextmanager
def started(folder: Path, *more: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """The program on a plan of one mission, and the port that it listens on."""
    plan = folder / "plan.json"
    plan.write_text(json.dumps(first_flight()), encoding="utf-8")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = ["-m", "mavlink_broker", "fly", str(plan), "--connect", f"udp://127.0.0.1:{port}"]
    process = subprocess.Popen(
        [sys.executable, *command, *more],
        cwd=ROOT,
        env=os.environ | {"STATE_DIR": str(folder)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process, port
    finally:
        process.kill()
        process.communicate()
