"""The whole broker in simulated time, between scripted vehicles and an edge server in memory."""

import json
import random
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.app import App
from mavlink_broker.config import Config
from mavlink_broker.effects import Job, JobOutcome
from mavlink_broker.links.url import Address
from mavlink_broker.mavlink.codec import Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mission.states import State
from mavlink_broker.pictures.worker_pool import run_job
from tests.support.fake_edge import FakeEdge
from tests.support.scripted_camera import ScriptedCamera
from tests.support.scripted_disk import ScriptedDisk
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import ARDUPILOT, HOME, PX4, Script

GENERIC = Script(autopilot=mavlink.MAV_AUTOPILOT_GENERIC)
FAMILIES = pytest.mark.parametrize("script", [PX4, ARDUPILOT, GENERIC])
FINISHED = [Status.FINISHED] * 3
EPOCH = datetime(2026, 11, 21, 8, 0, tzinfo=UTC)
TICK_S = 0.2
"""Period of the broker's steps, unless a test needs a finer one."""
ELSEWHERE = ("198.51.100.7", 40_000)
"""An address behind which no vehicle of a world is, unless a test puts one there."""
PLANS = Path(__file__).parents[2] / "examples" / "plans"
HOME_PLACE = {"latitude": HOME[0], "longitude": HOME[1]}


class Clock:
    """Simulated time, advanced by the world."""

    def __init__(self) -> None:
        self.now = 1000.0

    def monotonic(self) -> float:
        return self.now

    def utc(self) -> datetime:
        return EPOCH + timedelta(seconds=self.now - 1000.0)


class Air:
    """Datagrams between broker and vehicles; may lose some of them."""

    def __init__(self, clock: Clock, loss: float, seed: int) -> None:
        self.vehicles: dict[tuple[str, int], ScriptedVehicle] = {}
        self.cameras: dict[tuple[str, int], ScriptedCamera] = {}
        self.sent: list[tuple[Address, bytes]] = []
        self.is_uplink_up = True
        """To the vehicles."""
        self.is_downlink_up = True
        """From them to the broker."""
        self._clock = clock
        self._loss = loss
        self._random = random.Random(seed)
        self._to_broker: list[tuple[Address, bytes]] = []
        self._cameras_beat_at = 0.0
        self._delays_s: dict[int, float] = {}
        self._in_transit: list[tuple[float, Callable[[], None]]] = []

    def delay(self, vehicle: ScriptedVehicle, seconds: float) -> None:
        """Let a vehicle's frames take so long from now on, in each direction."""
        self._delays_s[id(vehicle)] = seconds

    def step(self) -> None:
        if self._clock.now >= self._cameras_beat_at:
            self._cameras_beat_at = self._clock.now + 1.0
            for camera in self.cameras.values():
                camera.heartbeat()
        for address, vehicle in self.vehicles.items():
            for frame in vehicle.step(self._clock.now):
                self._later(vehicle, partial(self.to_broker, address, frame))
        due = [arrive for at, arrive in self._in_transit if at <= self._clock.now]
        self._in_transit = [one for one in self._in_transit if one[0] > self._clock.now]
        for arrive in due:
            arrive()

    def _later(self, vehicle: ScriptedVehicle, arrive: Callable[[], None]) -> None:
        delay_s = self._delays_s.get(id(vehicle))
        if delay_s is None:
            arrive()
        else:
            self._in_transit.append((self._clock.now + delay_s, arrive))

    def to_broker(self, address: tuple[str, int] | Address, frame: bytes) -> None:
        if self._random.random() >= self._loss and self.is_downlink_up:
            self._to_broker.append((Address(*address), frame))

    @property
    def waiting(self) -> int:
        """How many datagrams the broker has not read."""
        return len(self._to_broker)

    def overflow(self, datagrams: int) -> None:
        """Lose what a buffer of so many datagrams has no room for: the newest."""
        del self._to_broker[datagrams:]

    def receive(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        del timeout_s
        datagrams, self._to_broker = self._to_broker, []
        return datagrams

    def send(self, address: Address, frame: bytes) -> None:
        self.sent.append((address, frame))
        vehicle = self.vehicles.get((address.host, address.port))
        if vehicle is None or not self.is_uplink_up:
            return
        if self._random.random() >= self._loss and not vehicle.silent:
            self._later(vehicle, lambda: self._arrive(vehicle, frame))
            if (address.host, address.port) in self.cameras:
                self.cameras[address.host, address.port].receive(frame)

    def _arrive(self, vehicle: ScriptedVehicle, frame: bytes) -> None:
        if not vehicle.silent:  # Frames in transit are lost with the link
            vehicle.receive(frame, self._clock.now)

    def radio_status(self, address: Address, free_percent: int) -> None:
        """This link has no buffer."""

    def contact_addresses(self) -> list[Address]:
        """No address is contacted first."""
        return []


class InlineJobs:
    """Does at once what the program does on threads; the outcome is there at the next step."""

    def __init__(self) -> None:
        self._finished: list[tuple[int, JobOutcome]] = []

    def put(self, system: int, job: Job) -> None:
        self._finished.append((system, run_job(job)))

    def take_finished(self) -> list[tuple[int, JobOutcome]]:
        finished, self._finished = self._finished, []
        return finished


class World:
    """Broker, edge server, vehicles and clock."""

    def __init__(
        self,
        *,
        loss: float = 0.0,
        seed: int = 1,
        config: Config | None = None,
        journal: Path | None = None,
        disk_lag_s: float = 0.0,
        tick_s: float = TICK_S,
    ) -> None:
        """Begin without vehicles; without a `journal` a killed broker keeps no record."""
        self.clock = Clock()
        self._tick_s = tick_s
        self.air = Air(self.clock, loss, seed)
        self.edge = FakeEdge()
        self.config = config or Config()
        self.disk = (
            None if journal is None else ScriptedDisk(journal, self.clock.monotonic, disk_lag_s)
        )
        self._encoders: dict[tuple[int, int], Encoder] = {}
        self._ulids = count(1)
        self.is_broker_running = True
        self.app = self._new_app()

    def _new_app(self) -> App:
        jobs = InlineJobs()
        return App(self.config, self.air, self.edge, self.clock, self.new_ulid, jobs, self.disk)

    def start_broker(self) -> None:
        """Start a broker with an empty memory, connected to the present edge server."""
        self.app = self._new_app()

    def new_ulid(self) -> str:
        return f"01{next(self._ulids):024d}"

    def kill_broker(self) -> None:
        """Kill the broker with its memory; none runs until it is restarted."""
        self.is_broker_running = False

    def restart_broker(self) -> None:
        """Begin with an empty memory, after a kill or instead of one."""
        self.is_broker_running = True
        if self.disk is not None:
            self.disk.begin()
        self.start_broker()
        self.edge.hand_out_again()

    def add_vehicle(self, system: int = 1, script: Script = PX4) -> ScriptedVehicle:
        vehicle = ScriptedVehicle(system, script, booted_at=self.clock.now)
        self.air.vehicles["192.0.2.1", 14580 + system] = vehicle
        return vehicle

    def add_camera(self, vehicle: ScriptedVehicle, **more: Any) -> ScriptedCamera:
        """Put a camera onto a vehicle; it is silent when the vehicle is."""
        address = next(a for a, v in self.air.vehicles.items() if v is vehicle)

        def put(frame: bytes) -> None:
            if not vehicle.silent:
                self.air.to_broker(address, frame)

        camera = ScriptedCamera(
            vehicle.system, put, lambda: round((self.clock.now - vehicle.booted_at) * 1e3), **more
        )
        self.air.cameras[address] = camera
        return camera

    def send_from(self, vehicle: ScriptedVehicle, message: Message, component: int = 1) -> None:
        """Send a message of a component of a vehicle."""
        address = next(a for a, v in self.air.vehicles.items() if v is vehicle)
        if component == 1:
            vehicle.send(message)
            return
        encoder = self._encoders.setdefault(
            (vehicle.system, component), Encoder(vehicle.system, component)
        )
        self.air.to_broker(address, encoder.encode(message))

    def send_camera_heartbeat(self, vehicle: ScriptedVehicle) -> None:
        """Send a heartbeat of a vehicle's camera."""
        heartbeat = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_CAMERA, 8, 0, 0, 4, 3)
        self.send_from(vehicle, heartbeat, mavlink.MAV_COMP_ID_CAMERA)

    @property
    def only_vehicle(self) -> ScriptedVehicle:
        """The vehicle of a world that has one."""
        (vehicle,) = self.air.vehicles.values()
        return vehicle

    def run(self, seconds: float) -> None:
        """Let so much time pass."""
        end = self.clock.now + seconds
        while self.clock.now < end:
            self.tick()

    def tick(self) -> None:
        self.clock.now += self._tick_s
        self.air.step()
        if self.is_broker_running:
            self.app.step(0.0)
        else:
            self.air.receive(0.0)  # No broker receives it

    def suspend_broker(self, seconds: float, *, is_full: bool = False) -> None:
        """Let time pass while the broker stands still; a full buffer takes nothing any more."""
        end, waiting = self.clock.now + seconds, self.air.waiting
        while self.clock.now < end:
            self.clock.now += self._tick_s
            self.air.step()
            if is_full:
                self.air.overflow(waiting)

    def run_until(self, condition: Callable[[], Any], within_s: float = 120.0) -> None:
        """Let time pass until the condition holds."""
        end = self.clock.now + within_s
        while not condition():
            assert self.clock.now < end, f"not within {within_s} s"
            self.tick()

    def run_until_over(self, mission_id: int, within_s: float = 240.0) -> None:
        """Let time pass until a mission has its terminal status."""
        self.run_until(lambda: (self.edge.status(mission_id) or 0) >= 3, within_s)


def takeoff(command_id: int = 1, altitude: float = 5.0, **more: Any) -> dict[str, Any]:
    place = {"latitude": HOME[0], "longitude": HOME[1], "altitude": altitude}
    return {"command_id": command_id, "command_type_id": 1, "parameters": place | more}


def waypoint(command_id: int = 2, north_m: float = 10.0, **more: Any) -> dict[str, Any]:
    place = {"latitude": HOME[0] + north_m * 9e-6, "longitude": HOME[1], "altitude": 5.0}
    return {"command_id": command_id, "command_type_id": 3, "parameters": place | more}


def land(command_id: int = 3, **more: Any) -> dict[str, Any]:
    place = {"latitude": HOME[0], "longitude": HOME[1]}
    return {"command_id": command_id, "command_type_id": 2, "parameters": place | more}


def go_home(command_id: int = 3, *, landing: bool = True) -> dict[str, Any]:
    return {"command_id": command_id, "command_type_id": 11, "parameters": {"landing": landing}}


def hotpoint(command_id: int = 2, **more: Any) -> dict[str, Any]:
    parameters = HOME_PLACE | {"orbit_altitude": 8.0, "radius": 10.0, "start_point": 1}
    return {"command_id": command_id, "command_type_id": 7, "parameters": parameters | more}


def circle(command_id: int = 2, **more: Any) -> dict[str, Any]:
    """A circle at a rate [deg/s]."""
    place = HOME_PLACE | {"orbit_altitude": 8.0, "radius": 20.0, "angular_velocity": 5.0}
    return {"command_id": command_id, "command_type_id": 7, "parameters": place | more}


def follow(command_id: int = 2, altitude: float = 9.0) -> dict[str, Any]:
    parameters = HOME_PLACE | {"altitude": altitude}
    return {"command_id": command_id, "command_type_id": 8, "parameters": parameters}


def image(command_id: int, pitch_deg: float, yaw_deg: float | None = None) -> dict[str, Any]:
    angles = {"pitch_angle": pitch_deg} | ({} if yaw_deg is None else {"yaw_angle": yaw_deg})
    return {"command_id": command_id, "command_type_id": 4, "parameters": angles}


def track(command_id: int = 2) -> dict[str, Any]:
    corners = {"corners": [[0.25, 0.25], [0.75, 0.75]]}
    return {"command_id": command_id, "command_type_id": 9, "parameters": corners}


def panorama(command_id: int = 2, mode: int = 1) -> dict[str, Any]:
    parameters = {"panorama_mode": mode}
    return {"command_id": command_id, "command_type_id": 10, "parameters": parameters}


def mission(*commands: dict[str, Any], mission_id: int = 1201, vehicle_id: int = 1) -> Any:
    return {
        "mission_id": mission_id,
        "vehicle_id": vehicle_id,
        "maximum_speed": 4.0,
        "command_array": list(commands),
    }


def first_flight(mission_id: int = 1201, vehicle_id: int = 1) -> Any:
    """Take-off, one waypoint, home."""
    return mission(takeoff(), waypoint(), go_home(), mission_id=mission_id, vehicle_id=vehicle_id)


def example_mission(name: str) -> Any:
    """The mission of an example plan."""
    document = json.loads((PLANS / f"{name}.json").read_text(encoding="utf-8"))
    return document.get("plan", document)["missions"][0]


def flying_world(
    script: Script = PX4, config: Config | None = None, *, tick_s: float = TICK_S
) -> World:
    """A world whose one vehicle has just been seen to fly."""
    world = World(config=config, tick_s=tick_s)
    world.add_vehicle(script=script)
    world.edge.plan(first_flight())
    world.run_until(lambda: any(s.state is State.RUNNING for s in world.app.sessions.values()))
    return world


def restart(world: World, away_s: float = 0.0) -> None:
    """Kill the broker, and start another one after so many seconds."""
    world.kill_broker()
    world.run(away_s)
    world.restart_broker()
