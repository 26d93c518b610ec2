"""The whole broker against the project's own vehicle in one process, in vehicle time.

Nothing is paced and nothing listens on a socket: what happens depends on the seeds alone. The
broker may be dropped and made anew at any moment, the link between may lose, delay, double and
reorder; the simulator's truth is the vehicle's position.
"""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from itertools import count
from pathlib import Path
from typing import Any, Final, NamedTuple

from afarcloud.enumerations import Status
from mavlink_broker.app import App
from mavlink_broker.config import Config
from mavlink_broker.links.url import Address
from mavlink_broker.mavlink.codec import Decoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from sim.config import SimulationConfig
from sim.simulation import Simulation
from tests.support.broker_world import InlineJobs
from tests.support.fake_edge import FakeEdge
from tests.support.geodesy import LocalGround
from tests.support.lossy_link import GROUND_ADDRESS, VEHICLE_ADDRESS, Conditions, LossyLink
from tests.support.scripted_disk import ScriptedDisk
from uav_firmware.drivers.file_storage import FileStorage
from uav_firmware.drivers.file_tree import image_folder, image_tree, storage_card
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.drivers.jsbsim_camera import JsbsimCamera
from uav_firmware.drivers.log_folder import LogFolder
from uav_firmware.module_errors import end_flight
from uav_firmware.modules.mavlink.wire.peers import Peer, Profile
from uav_firmware.topology import Autopilot

EPOCH: Final = datetime(2026, 11, 21, 8, 0, tzinfo=UTC)
STEPS_PER_ROUND: Final = 10
"""Of the vehicle, 4 ms each, to one of the broker."""
PERFECT: Final = Conditions()


class Frame(NamedTuple):
    """What the broker sent, and when [s]."""

    time_s: float
    kind: str
    command: int  # MAV_CMD; 0 for what is no command
    message: Message


class Clock:
    """The vehicle's time, which is everybody's."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def monotonic(self) -> float:
        """Seconds."""
        return 1000.0 + self.now_s

    def utc(self) -> datetime:
        """Time of day."""
        return EPOCH + timedelta(seconds=self.now_s)


class BrokerEnd:
    """The broker's socket, and an ear at it."""

    def __init__(self, link: LossyLink, clock: Clock) -> None:
        self._link = link
        self._clock = clock
        self._decoder = Decoder()
        self.sent: list[Frame] = []

    def receive(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        """Give what has arrived; there is no waiting here."""
        del timeout_s
        return [(Address(*sender), datagram) for datagram, sender in self._link.ground.receive()]

    def send(self, address: Address, frame: bytes) -> None:
        """Send to the vehicle, and note it down."""
        for message in self._decoder.decode(frame):
            command = int(getattr(message, "command", 0))
            self.sent.append(Frame(self._clock.now_s, message.get_type(), command, message))
        self._link.ground.send(frame, (address.host, address.port))

    def radio_status(self, address: Address, free_percent: int) -> None:
        """Nothing fills up here."""

    def contact_addresses(self) -> list[Address]:
        """None: the vehicle sends first."""
        return []


class FlyingWorld:
    """A vehicle, an edge server in memory, and a broker between them, or none."""

    def __init__(
        self,
        folder: Path,
        *,
        to_broker: Conditions = PERFECT,
        to_vehicle: Conditions = PERFECT,
        seed: int = 1,
        with_camera: bool = False,
        disk_lag_s: float = 0.0,
    ) -> None:
        """Begin on the ground; without a camera pictures are reckoned, and nothing is stored."""
        self.clock = Clock()
        self.edge = FakeEdge()
        self.link = LossyLink(to_broker, to_vehicle, seed=seed)
        self.air = BrokerEnd(self.link, self.clock)
        self.simulation = Simulation(SimulationConfig(seed=seed, gps="rtk"))
        images = image_tree(folder)
        camera = JsbsimCamera(
            self.simulation, image_folder(folder), images.room, serial="F450-1", in_step=True
        )
        self.vehicle = JsbsimVehicle(self.simulation, camera=camera if with_camera else None)
        self.autopilot = Autopilot(
            self.vehicle,
            self.link.vehicle,
            FileStorage(folder),
            system_id=1,
            peers=(Peer(address=GROUND_ADDRESS, profile=Profile.ONBOARD),),
            boot_time_utc_us=0,
            write_line=lambda _time_us, _text: None,
            card=storage_card(folder, LogFolder(folder / "log"), images) if with_camera else None,
            on_error=end_flight,
        )
        start = self.simulation.truth
        self.ground = LocalGround(start.latitude_deg, start.longitude_deg, start.altitude_amsl_m)
        self._ulids = count(1)
        self.disk = ScriptedDisk(folder / "broker", self.clock.monotonic, disk_lag_s)
        self.app: App | None = None
        self.start_broker()

    # The broker's life.

    def start_broker(self) -> None:
        """Begin with nothing but the journal; all unfinished work is handed out again."""
        self.link.ground.receive()  # Datagrams that arrive without a broker are lost
        self.disk.begin()
        jobs = InlineJobs()
        self.app = App(Config(), self.air, self.edge, self.clock, self._ulid, jobs, self.disk)
        self.edge.hand_out_again()

    def kill_broker(self) -> None:
        """Lose everything that it knows, but for its journal."""
        self.app = None

    def _ulid(self) -> str:
        return f"01{next(self._ulids):024d}"

    # Time.

    def run(self, seconds: float) -> None:
        """Let so much time pass."""
        end_s = self.clock.now_s + seconds
        while self.clock.now_s < end_s:
            self.go_round()

    def run_until(self, condition: Callable[[], Any], within_s: float = 300.0) -> None:
        """Let time pass until the condition holds."""
        end_s = self.clock.now_s + within_s
        while not condition():
            assert self.clock.now_s < end_s, f"not within {within_s} s: {self.outline()}"
            self.go_round()

    def run_until_over(self, mission_id: int, within_s: float = 600.0) -> None:
        """Let time pass until a mission has its terminal status."""
        self.run_until(lambda: self.is_over(mission_id), within_s)

    def go_round(self) -> None:
        """Some steps of the vehicle, one of the broker."""
        for _ in range(STEPS_PER_ROUND):
            self.autopilot.scheduler.step()
            time_us = self.autopilot.vehicle.time_us
            self.link.advance(time_us)
            if self.link.vehicle.inbox:
                self.autopilot.serve_link()
        self.clock.now_s = self.autopilot.vehicle.time_us * 1e-6
        self.link.advance(self.autopilot.vehicle.time_us)
        if self.app is None:
            self.link.ground.receive()
        else:
            self.app.step(0.0)
            self.link.advance(self.autopilot.vehicle.time_us)
            self.autopilot.serve_link()

    # What there is to see.

    def is_over(self, mission_id: int) -> bool:
        """Whether a mission has its terminal status."""
        status = self.edge.status(mission_id)
        return status is not None and Status(status).is_terminal

    def running(self, mission_id: int) -> int | None:
        """Place of the command that is reported to run."""
        if not self.edge.reports(mission_id):
            return None
        statuses = self.edge.statuses(mission_id)
        return statuses.index(Status.RUNNING) if Status.RUNNING in statuses else None

    @property
    def session_state(self) -> str:
        """What the broker does for the vehicle; nothing where there is no broker."""
        session = None if self.app is None else self.app.sessions.get(1)
        return "" if session is None else session.state.name

    @property
    def pictures(self) -> int:
        """How many pictures the vehicle's camera has taken."""
        camera = self.autopilot.topics.camera_status.value
        return 0 if camera is None else camera.image_count

    @property
    def is_armed(self) -> bool:
        """As the vehicle reports it, whether or not that arrives."""
        status = self.autopilot.topics.vehicle_status.value
        return status is not None and status.armed

    @property
    def mode(self) -> str:
        """Name of the vehicle's mode, from itself."""
        status = self.autopilot.topics.vehicle_status.value
        return "" if status is None else status.navigation_state.name

    @property
    def place(self) -> tuple[float, float, float]:
        """True metres north and east of the start, and above it."""
        truth = self.simulation.truth
        north, east = self.ground.north_east_m(truth.latitude_deg, truth.longitude_deg)
        return north, east, truth.height_above_home_m

    def away_m(self, latitude_deg: float, longitude_deg: float) -> float:
        """True horizontal distance of the vehicle from a place."""
        north, east, _ = self.place
        other = self.ground.north_east_m(latitude_deg, longitude_deg)
        return math.hypot(north - other[0], east - other[1])

    def orders(self, *commands: int) -> Sequence[Frame]:
        """Frames with one of these commands, but for repetitions of the same one."""
        return [
            frame
            for frame in self.air.sent
            if frame.command in commands
            and frame.kind.startswith("COMMAND_")
            and not getattr(frame.message, "confirmation", 0)
        ]

    @property
    def order_counts(self) -> Mapping[int, int]:
        """How often each command was given."""
        given = (f for f in self.air.sent if f.kind in {"COMMAND_LONG", "COMMAND_INT"})
        return Counter(f.command for f in given if not getattr(f.message, "confirmation", 0))

    @property
    def item_times(self) -> Sequence[float]:
        """When mission items were sent."""
        return [frame.time_s for frame in self.air.sent if frame.kind == "MISSION_ITEM_INT"]

    def outline(self) -> str:
        """Return the state of the flight, for the message of a failed test."""
        sessions = {} if self.app is None else self.app.sessions
        states = [session.state.name for session in sessions.values()]
        reports = self.edge.bodies("/mission_report/")[-1:]
        place = ", ".join(f"{metres:.1f}" for metres in self.place)
        return f"t={self.clock.now_s:.1f} {states} {self.mode} at {place}; {reports}"


__all__ = ["VEHICLE_ADDRESS", "Conditions", "FlyingWorld", "Frame", "mavlink"]
