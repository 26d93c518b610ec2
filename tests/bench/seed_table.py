"""The times and memory of the first system's thesis, its Table 3, measured on this one.

The thesis measured five executions between a tester module and its broker, per message type: how
long a message travels (propagation), how long its receiver works until the mission begins or the
JSON has gone through the socket (processing), and by how much the process grows meanwhile; without
and with locks and queues around what several threads write. It gives medians, and so does this.

Here the broker's loop runs in this process, between scripted vehicles on real sockets, each with a
thread of its own, and an edge server over real HTTP: one vehicle, then five that write at once. Its
growth is that of a broker process with one vehicle.

    mission         from the answer with the mission to its start on the vehicle; propagation is
                    its upload, from MISSION_COUNT to MISSION_ACK
    mission report  from the vehicle's frame that ends a command to the report at the edge server
    pose            the same, to the pose
    event           from the answer with an abort to the order on the vehicle
    alarm           from the frame with the failure to the alarm, without the two seconds for which
                    a failure must last

The growth of a report, a pose or an alarm is that since the post before; that of a mission is of
the first one of a process.
"""

import dataclasses
import logging
import os
import select
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

from ulid import ULID

from afarcloud.enumerations import EventType, Status
from mavlink_broker.app import App
from mavlink_broker.cli.program import SystemClock
from mavlink_broker.config import Config
from mavlink_broker.edge.client import EdgeClient
from mavlink_broker.links.hub import Hub
from mavlink_broker.links.url import Address, LinkKind, LinkUrl
from mavlink_broker.mavlink.codec import message_id
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.vehicle.alarms import DEBOUNCE_S
from tests.bench.results import Result, at_most
from tests.support.broker_world import go_home, mission, takeoff, waypoint
from tests.support.fake_edge import FakeEdgeServer
from tests.support.polling import PATIENCE_S
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.system import free_ports, wait_for
from tests.support.vehicle_script import PX4

EXECUTIONS: Final = 5
WRITERS: Final = 5
WAYPOINTS: Final = 4
_KEY: Final = "secret"
_SCRIPT: Final = dataclasses.replace(PX4, item_time_s=0.5)
_SLOW: Final = dataclasses.replace(PX4, item_time_s=60.0)
_STEP_S: Final = 0.005
_SETTLED_S: Final = 3.0
"""A vehicle is known, its streams are set and the link is quiet."""
_GPS: Final = mavlink.MAV_SYS_STATUS_SENSOR_GPS
_PAGE_KB: Final = os.sysconf("SC_PAGE_SIZE") / 1024.0
_SHOWN_AS: Final = {"propagation": "propagation", "processing": "processing", "memory": "growth"}


class Figures(NamedTuple):
    """Medians of the thesis for one message type."""

    propagation: float  # [s]
    processing: float  # [s]
    memory: float  # [kB] Negative: released


THESIS: Final[Mapping[str, tuple[Figures, Figures]]] = {
    "mission": (Figures(0.1683, 8.3149, 2.576), Figures(0.2326, 9.1889, 14.6)),
    "mission report": (Figures(0.0941, 0.3267, 18.6), Figures(0.0017, 0.5641, 3.216)),
    "pose": (Figures(0.0888, 0.0011, 0.44), Figures(0.2822, 0.0025, 0.44)),
    "event": (Figures(0.2187, 2.6905, 15.1), Figures(0.0285, 4.0327, 26.3)),
    "alarm": (Figures(0.0244, 0.8021, 16.2), Figures(0.8086, 6.2925, 6.886)),
}
"""Without and with locks and queues, as its Table 3 prints them or as its five values give them."""


class Note(NamedTuple):
    """A frame, and when a vehicle sent or received it."""

    time: float  # [s] Monotonic
    content: bytes


Samples = dict[tuple[str, str], list[float]]
"""By message type and by kind of figure."""


class TimedHub:
    """A hub that notes when frames are received and sent."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self.received: dict[bytes, float] = {}
        self.sent: dict[bytes, float] = {}

    def receive(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        arrivals = self._hub.receive(timeout_s)
        now = time.monotonic()
        for _, data in arrivals:
            self.received[data] = now
        return arrivals

    def send(self, address: Address, frame: bytes) -> None:
        self.sent[frame] = time.monotonic()
        self._hub.send(address, frame)

    def radio_status(self, address: Address, free_percent: int) -> None:
        self._hub.radio_status(address, free_percent)

    def contact_addresses(self) -> list[Address]:
        return self._hub.contact_addresses()


class Pilot:
    """A scripted vehicle with a socket and a thread, and what passed it."""

    def __init__(self, system: int, port: int) -> None:
        self.vehicle = ScriptedVehicle(system, _SCRIPT, booted_at=time.monotonic())
        self.sent: list[Note] = []
        self.received: list[Note] = []
        self.began: list[float] = []  # When it began its missions
        self._port = port
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._live)
        self._thread.start()

    def stop(self) -> None:
        """End it."""
        self._stop.set()
        self._thread.join()

    @property
    def _is_active(self) -> bool:
        return bool(self.vehicle.mission_state == mavlink.MISSION_STATE_ACTIVE)

    def _live(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
            own.bind(("127.0.0.1", 0))
            while not self._stop.is_set():
                if select.select([own], [], [], _STEP_S)[0]:
                    data = own.recv(2048)
                    now = time.monotonic()
                    self.received.append(Note(now, data))
                    was_active = self._is_active
                    self.vehicle.receive(data, now)
                    if self._is_active and not was_active:
                        self.began.append(now)
                for frame in self.vehicle.step(time.monotonic()):
                    self.sent.append(Note(time.monotonic(), frame))
                    own.sendto(frame, ("127.0.0.1", self._port))


class Farm:
    """Edge server and vehicles of one execution; a broker is started beside them."""

    def __init__(self, server: FakeEdgeServer, port: int, vehicles: int) -> None:
        self.server = server
        self.posts: list[tuple[float, str, dict[str, Any]]] = []
        server.judge = self._note
        self.pilots = [Pilot(system, port) for system in range(1, vehicles + 1)]
        self.on_handed_out: Callable[[], None] = _nothing
        self.on_post: Callable[[str], None] = _nothing

    def _note(self, path: str, body: dict[str, Any]) -> None:
        self.posts.append((time.monotonic(), path, body))
        self.on_post(path)

    def wait_until_known(self) -> None:
        """Wait for every vehicle at the edge server, and until the link is quiet."""
        known = {f"/vehicles/{pilot.vehicle.system}" for pilot in self.pilots}
        wait_for(lambda: known <= {path for _, path, _ in self.posts}, "vehicles")
        time.sleep(_SETTLED_S)

    def hand_out(self, mission_id: int) -> float:
        """Hand out a mission to every vehicle; gives the time."""
        self.on_handed_out()
        now = time.monotonic()
        for pilot in self.pilots:
            self.server.plan(_mission(mission_id + pilot.vehicle.system, pilot.vehicle.system))
        return now

    def abort(self) -> float:
        """Hand out an abort to every vehicle; gives the time."""
        self.on_handed_out()
        now = time.monotonic()
        for pilot in self.pilots:
            self.server.event(EventType.ABORT_MISSION, pilot.vehicle.system)
        return now

    def wait_for_status(self, mission_id: int, status: Status) -> None:
        """Wait until every vehicle's mission has a status."""
        numbers = [mission_id + pilot.vehicle.system for pilot in self.pilots]
        wait_for(
            lambda: all(self.server.edge.status(n) == status for n in numbers) or None,
            f"missions {status.name}",
        )

    def wait_for_start(self, number: int) -> None:
        """Wait until every vehicle flies its first, second, ... mission."""
        wait_for(lambda: all(len(p.began) >= number for p in self.pilots), "the start")

    def fail_gps(self) -> None:
        """Let every vehicle report that its GPS has failed."""
        for pilot in self.pilots:
            pilot.vehicle.ill = _GPS

    def reports_of(self, pilot: Pilot) -> list[float]:
        """When a report of the first mission named one more finished command."""
        times, finished = [], 0
        for at, path, body in self.posts:
            if path != "/mission_report/" or body["mission_id"] != 100 + pilot.vehicle.system:
                continue
            statuses = [one["command_status_id"] for one in body["command_report_array"]]
            if statuses.count(Status.FINISHED) > finished:
                finished = statuses.count(Status.FINISHED)
                times.append(at)
        return times

    def poses_of(self, pilot: Pilot) -> list[float]:
        """When the poses of a vehicle arrived."""
        system = pilot.vehicle.system
        return [
            at
            for at, path, body in self.posts
            if (path, body.get("vehicle_id")) == ("/pose/", system)
        ]

    def wait_for_alarms(self) -> None:
        """Wait for an alarm of every vehicle."""
        count = len(self.pilots)
        wait_for(lambda: len(self.server.edge.bodies("/alarm/")) >= count, "alarms")

    def stop(self) -> None:
        """End the vehicles."""
        for pilot in self.pilots:
            pilot.stop()


def _nothing(*_: object) -> None:
    """Note nothing."""


def _mission(mission_id: int, vehicle_id: int) -> Any:
    points = [waypoint(command_id=number) for number in range(2, WAYPOINTS + 2)]
    commands = (takeoff(), *points, go_home(command_id=WAYPOINTS + 2))
    return mission(*commands, mission_id=mission_id, vehicle_id=vehicle_id)


@contextmanager
def _farm(port: int, vehicles: int) -> Iterator[Farm]:
    with FakeEdgeServer(0, _KEY).running() as server:
        farm = Farm(server, port, vehicles)
        try:
            yield farm
        finally:
            farm.stop()


@contextmanager
def _broker(folder: Path, farm: Farm, port: int) -> Iterator[TimedHub]:
    """The broker's loop in a thread, with the edge client's threads beside it."""
    key = folder / "broker.key"
    key.write_text(_KEY)
    hub = Hub()
    hub.add(LinkUrl(LinkKind.UDP_IN, "127.0.0.1", port))
    timed = TimedHub(hub)
    edge = EdgeClient(farm.server.url, key, hub.wake)
    edge.start()
    app = App(Config(mavlink_port=port), timed, edge, SystemClock(), lambda: str(ULID()))
    stop = threading.Event()

    def run() -> None:
        while not stop.is_set():
            app.step()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield timed
    finally:
        stop.set()
        thread.join()
        app.close()
        edge.stop(0.0)
        hub.close()


def _fly(farm: Farm) -> tuple[float, float]:
    """Fly a mission to its end, abort another, fail; gives the times of the two orders."""
    farm.wait_until_known()
    handed_out = farm.hand_out(100)
    farm.wait_for_status(100, Status.FINISHED)
    for pilot in farm.pilots:
        pilot.vehicle.script = _SLOW
    farm.hand_out(200)
    farm.wait_for_start(2)
    farm.wait_for_status(200, Status.RUNNING)
    aborted = farm.abort()
    farm.wait_for_status(200, Status.ABORTED)
    wait_for(lambda: not any(p.vehicle.armed for p in farm.pilots), "the ground")
    farm.fail_gps()
    farm.wait_for_alarms()
    return handed_out, aborted


def execute(folder: Path, vehicles: int) -> Samples:
    """One execution; gives its times [s]."""
    (port,) = free_ports(1)
    samples: Samples = {}
    with _farm(port, vehicles) as farm, _broker(folder, farm, port) as hub:
        handed_out, aborted = _fly(farm)
        for pilot in farm.pilots:
            for kind, propagation, processing in (
                *_of_mission(pilot, hub, handed_out),
                *_of_posts(pilot, hub, farm),
                *_of_event(pilot, hub, aborted),
                *_of_alarm(pilot, hub, farm),
            ):
                samples.setdefault((kind, "propagation"), []).append(propagation)
                samples.setdefault((kind, "processing"), []).append(processing)
    return samples


def _first(notes: Sequence[Note], kind: int, after: float) -> Note:
    return next(n for n in notes if n.time >= after and message_id(n.content) == kind)


def _of_mission(
    pilot: Pilot, hub: TimedHub, handed_out: float
) -> Iterator[tuple[str, float, float]]:
    count = _first(pilot.received, mavlink.MAVLINK_MSG_ID_MISSION_COUNT, handed_out)
    ack = _first(pilot.sent, mavlink.MAVLINK_MSG_ID_MISSION_ACK, count.time)
    propagation = ack.time - hub.sent[count.content]
    yield "mission", propagation, pilot.began[0] - handed_out - propagation


def _command(frame: bytes) -> int:
    """The command of a COMMAND_LONG or COMMAND_INT of MAVLink 2: after seven numbers."""
    payload = frame[10 : 10 + frame[1]].ljust(33, b"\0")
    return int.from_bytes(payload[28:30], "little")


def _of_posts(pilot: Pilot, hub: TimedHub, farm: Farm) -> Iterator[tuple[str, float, float]]:
    """Reports and poses of the commands that end with an item of the mission: all but the last."""
    reached = [
        note
        for note in pilot.sent
        if message_id(note.content) == mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED
        and note.content in hub.received
    ]
    for kind, times in (("mission report", farm.reports_of(pilot)), ("pose", farm.poses_of(pilot))):
        for at in times[: WAYPOINTS + 1]:
            cause = [note for note in reached if hub.received[note.content] <= at][-1]
            received = hub.received[cause.content]
            yield kind, received - cause.time, at - received


def _of_event(pilot: Pilot, hub: TimedHub, aborted: float) -> Iterator[tuple[str, float, float]]:
    orders = (mavlink.MAVLINK_MSG_ID_COMMAND_LONG, mavlink.MAVLINK_MSG_ID_COMMAND_INT)
    order = next(
        note
        for note in pilot.received
        if note.time >= aborted
        and message_id(note.content) in orders
        and _command(note.content) in {mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_NAV_LAND}
    )
    sent = hub.sent[order.content]
    yield "event", order.time - sent, sent - aborted


def _of_alarm(pilot: Pilot, hub: TimedHub, farm: Farm) -> Iterator[tuple[str, float, float]]:
    first = next(
        note
        for note in pilot.sent
        if message_id(note.content) == mavlink.MAVLINK_MSG_ID_SYS_STATUS
        and not _healthy(note.content) & _GPS
    )
    at = next(
        at
        for at, path, body in farm.posts
        if path == "/alarm/" and body["vehicle_id"] == pilot.vehicle.system
    )
    received = hub.received[first.content]
    yield "alarm", received - first.time, at - received - DEBOUNCE_S


def _healthy(frame: bytes) -> int:
    """Third number of a SYS_STATUS of MAVLink 2: the sensors that are healthy."""
    return int.from_bytes(frame[10 : 10 + frame[1]].ljust(12, b"\0")[8:12], "little")


def growth(folder: Path) -> Samples:
    """One execution with a broker process; gives by how much it grows [kB] per message type."""
    (port,) = free_ports(1)
    samples: Samples = {}
    kinds = {"/mission_report/": "mission report", "/pose/": "pose", "/alarm/": "alarm"}
    with _farm(port, 1) as farm, _broker_process(folder, farm, port) as process:
        before = [0.0]

        def handed_out() -> None:
            before[0] = _resident_kb(process.pid)

        def post(path: str) -> None:
            now = _resident_kb(process.pid)
            if path in kinds:
                samples.setdefault((kinds[path], "memory"), []).append(now - before[0])
            before[0] = now

        farm.on_handed_out, farm.on_post = handed_out, post
        farm.wait_until_known()
        (pilot,) = farm.pilots
        resident = _resident_kb(process.pid)
        farm.hand_out(100)
        farm.wait_for_start(1)
        samples["mission", "memory"] = [_resident_kb(process.pid) - resident]
        farm.wait_for_status(100, Status.FINISHED)
        pilot.vehicle.script = _SLOW
        farm.hand_out(200)
        farm.wait_for_start(2)
        farm.wait_for_status(200, Status.RUNNING)
        resident = _resident_kb(process.pid)
        farm.abort()
        farm.wait_for_status(200, Status.ABORTED)
        samples["event", "memory"] = [_resident_kb(process.pid) - resident]
        farm.fail_gps()
        farm.wait_for_alarms()
    return samples


@contextmanager
def _broker_process(folder: Path, farm: Farm, port: int) -> Iterator["subprocess.Popen[bytes]"]:
    key = folder / "keys" / "broker.key"
    key.parent.mkdir()
    key.write_text(_KEY)
    environment = os.environ | {
        "STATE_DIR": str(folder),
        "MAVLINK_PORT": str(port),
        "EDGE_URL": farm.server.url,
    }
    with subprocess.Popen(
        [sys.executable, "-m", "mavlink_broker"], env=environment, stderr=subprocess.DEVNULL
    ) as process:
        try:
            yield process
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait(PATIENCE_S)


def _resident_kb(process_id: int) -> float:
    return int(Path(f"/proc/{process_id}/statm").read_text().split()[1]) * _PAGE_KB


def measure() -> Iterator[Result]:
    """Give every figure with the thesis's median as its bar."""
    logging.getLogger("mavlink_broker").setLevel(logging.CRITICAL)  # It reports what is planned
    for vehicles, column in ((1, 0), (WRITERS, 1)):
        writers = "one writer" if vehicles == 1 else f"{vehicles} writers at once"
        samples = _executions(partial(execute, vehicles=vehicles))
        for kind, figures in THESIS.items():
            for name in ("propagation", "processing"):
                values = samples[kind, name]
                bar = getattr(figures[column], name)
                title = f"{kind}, {_SHOWN_AS[name]}, {writers}"
                yield at_most(title, statistics.median(values), "s", bar, values)
    samples = _executions(growth)
    for kind, figures in THESIS.items():
        values = samples[kind, "memory"]
        title = f"{kind}, {_SHOWN_AS['memory']} of the broker"
        yield at_most(title, statistics.median(values), "kB", figures[0].memory, values)


def _executions(execute_once: Callable[[Path], Samples]) -> Samples:
    """Samples of several executions, each with a folder and processes of its own."""
    samples: Samples = {}
    for _ in range(EXECUTIONS):
        with tempfile.TemporaryDirectory() as folder:
            for name, values in execute_once(Path(folder)).items():
                samples.setdefault(name, []).extend(values)
    return samples
