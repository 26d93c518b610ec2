"""One simulated farm: edge server, relay, cloud, broker, vehicles, and the network between them."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from http import HTTPStatus
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING, Any, Final
from unittest.mock import patch

import ulid

from dst.scheduler import KEPT_LINES, Clock, Scheduler
from dst.vehicles.autopilot import FAMILIES, Autopilot
from dst.vehicles.flight import Truth
from dst.vehicles.vehicle import Vehicle
from dst.world.broker_process import BrokerProcess
from dst.world.disk import Disk, attached
from dst.world.edge_http import EdgeHttp
from dst.world.edge_process import (
    BREAK_HOUSEKEEPING_S,
    HOUSEKEEPING_S,
    Cloud,
    EdgeProcess,
    RelayProcess,
    Response,
)
from dst.world.machine import Machine
from dst.world.network import Path as NetworkPath
from mavlink_broker.database import DATABASE_FILE
from mavlink_broker.links.url import Address

if TYPE_CHECKING:
    from dst.vehicles.flight_stack import FlightStack

VEHICLE_PORT: Final = 14580
"""UDP port of the vehicle with system id 0; the others follow."""
TWIN_PORT: Final = 14680
TWIN_SERIAL: Final = 10_000  # Times its number, to the serial number of another aircraft


class World:
    """All parts of a simulation; the caller that makes one closes it."""

    def __init__(
        self,
        seed: int,
        prepared: Path,
        folder: Path,
        *,
        vehicles: int = 1,
        families: Sequence[Autopilot] = FAMILIES,
        is_deep: bool = False,
        has_cameras: bool = False,
        kept_lines: int | None = KEPT_LINES,
    ) -> None:
        """Begin with every process up; `prepared` is an edge server's state folder to copy.

        Each vehicle has one of the autopilot families; in depth, the whole flight stack on JSBSim.
        """
        self._has_cameras = has_cameras
        self.scheduler = Scheduler(seed, kept_lines=kept_lines)
        disk, broker_disk = (
            Disk(folder / name, self.scheduler.random(f"disk/{name}"))
            for name in ("edge", "broker")
        )
        self._disks = ExitStack()
        self._disks.enter_context(attached(disk, broker_disk))
        clock, broker_clock = Clock(self.scheduler), Clock(self.scheduler)
        self._disks.enter_context(_ids_of(self.scheduler.random("ids"), clock))
        self.edge = EdgeProcess(self.scheduler, prepared, folder / "edge", disk, clock)
        self.cloud = Cloud(self.scheduler, self.edge.config, disk, clock)
        self.relay = RelayProcess(self.scheduler, self.edge.config, self.cloud, clock)
        self.edge.on_write = self.relay.wake
        self.http = EdgeHttp(self.scheduler, self.edge)
        self.broker = BrokerProcess(
            self.scheduler,
            self.http,
            folder / "broker",
            broker_disk,
            broker_clock,
            self._to_vehicle,
        )
        edge_file, broker_file = self.edge.config.database_path, folder / "broker" / DATABASE_FILE
        self.edge_machine = Machine(
            self.scheduler, "edge machine", disk, clock, edge_file, (self.edge, self.relay)
        )
        self.broker_machine = Machine(
            self.scheduler, "broker machine", broker_disk, broker_clock, broker_file, (self.broker,)
        )
        self.vehicles: dict[int, Vehicle | FlightStack] = {}
        self.twins: dict[int, Vehicle] = {}
        # By system id: each that has had it
        self._aircraft: dict[int, list[Vehicle | FlightStack]] = {}
        self.twinned: set[int] = set()
        """System ids that two aircraft have had at once."""
        self.on_frame: list[Callable[[int, bytes], None]] = []
        """Called with each frame that the broker or a vehicle sends, by the vehicle's system id."""
        self.on_event: list[Callable[[], None]] = []
        """Called when the edge server has taken an event of the operator."""
        self.connected_s = dict.fromkeys(range(1, vehicles + 1), 0.0)
        """Since when broker and link of each vehicle are up, or were for the last time."""
        self.is_break = False
        """Whether every vehicle stays switched off, until the next shift."""
        self.up: dict[int, NetworkPath] = {}
        self.down: dict[int, NetworkPath] = {}
        families_drawn = self.scheduler.random("families")
        for system in range(1, vehicles + 1):
            family = families_drawn.choice(families)
            self._add_vehicle(system, family, folder / f"vehicle-{system}" if is_deep else None)

    def _add_vehicle(self, system: int, autopilot: Autopilot, folder: Path | None) -> None:
        """Add a vehicle of a family, or the flight stack with its storage in a folder."""
        arrive = partial(self.broker.arrive, Address("192.0.2.1", VEHICLE_PORT + system))
        up = self.up[system] = NetworkPath(self.scheduler, f"up/{system}", arrive)

        def send(frame: bytes) -> None:
            self._note_frame(system, frame)
            up.send(frame)

        vehicle = (
            Vehicle(self.scheduler, system, send, autopilot, has_camera=self._has_cameras)
            if folder is None
            else _flight_stack(self.scheduler, system, send, folder)
        )
        self.vehicles[system] = vehicle
        self._aircraft[system] = [vehicle]
        self.scheduler.note(f"vehicle {system}", "-", f"is {vehicle.autopilot.name}")
        self.down[system] = NetworkPath(self.scheduler, f"down/{system}", vehicle.receive)

    def add_twin(self, system: int) -> None:
        """Switch on another aircraft with the system id of one, until `remove_twin`."""
        self.remove_twin(system)
        self.twinned.add(system)
        arrive = partial(self.broker.arrive, Address("192.0.2.2", TWIN_PORT + system))
        up = NetworkPath(self.scheduler, f"up/twin {system}", arrive)
        twin = Vehicle(self.scheduler, system, up.send, self.vehicles[system].autopilot)
        twin.serial += TWIN_SERIAL * len(self._aircraft[system])
        self.twins[system] = twin
        self._aircraft[system].append(twin)

    def truths(self, system: int) -> list[Truth]:
        """Give what each aircraft did that has had a system id."""
        return [aircraft.truth for aircraft in self._aircraft[system]]

    def remove_twin(self, system: int) -> None:
        """Switch off the other aircraft with a system id, if there is one."""
        twin = self.twins.get(system)
        if twin is not None:
            twin.switch_off()

    def _to_vehicle(self, address: Address, frame: bytes) -> None:
        path = self.down.get(address.port - VEHICLE_PORT)
        twin = self.twins.get(address.port - TWIN_PORT)
        if path is not None:
            self._note_frame(address.port - VEHICLE_PORT, frame)
            path.send(frame)
        elif twin is not None:
            self.scheduler.after(0.005, lambda: twin.receive(frame))

    def _note_frame(self, system: int, frame: bytes) -> None:
        for note in self.on_frame:
            note(system, frame)

    def switch_off(self) -> None:
        """Switch every vehicle off; call it while none flies."""
        for vehicle in (*self.vehicles.values(), *self.twins.values()):
            vehicle.switch_off()
        self.edge.housekeeping_s = BREAK_HOUSEKEEPING_S
        self.is_break = True

    def switch_on(self) -> None:
        """Switch every vehicle on."""
        for system, vehicle in self.vehicles.items():
            vehicle.switch_on()
            self.connected(system)
        self.edge.housekeeping_s = HOUSEKEEPING_S
        self.is_break = False

    def connected(self, system: int) -> None:
        """Note that a vehicle's link or the broker is up again."""
        self.connected_s[system] = self.scheduler.now_s

    def run(self, seconds: float) -> None:
        """Let so much virtual time pass."""
        self.scheduler.run_until(self.scheduler.now_s + seconds)

    def request(self, method: str, path: str, body: Any = None, key: str | None = None) -> Response:
        """Send a request of the operator to the edge server.

        Raises:
            EdgeDownError: if it does not run.
        """
        headers = {} if key is None else {"Idempotency-Key": key}
        response = self.edge.request(method, path, "operator", body, headers)
        if method != "GET":
            text = f"{method} {path} {response.status}"
            self.scheduler.note("operator", "edge server", text)
        if (method, path, response.status) == ("POST", "/events/", HTTPStatus.CREATED):
            for note in self.on_event:
                note()
        return response

    def close(self) -> None:
        """End every process."""
        for machine in (self.edge_machine, self.broker_machine):
            machine.restore()
        for process in (self.broker, self.relay, self.edge):
            if process.is_up:
                process.kill()
        self._disks.close()


@contextmanager
def _ids_of(random: Random, clock: Clock) -> Iterator[None]:
    """Have ULIDs made from a clock and a source of random numbers, not from this machine's."""
    ids = ulid.ULIDGenerator(
        clock=lambda: int(clock.epoch_s() * 1e3), randomness=lambda _time_ms: random.randbytes(10)
    )
    with patch.object(ulid, "default_generator", ids):
        yield


def _flight_stack(
    scheduler: Scheduler, system: int, send: Callable[[bytes], None], folder: Path
) -> "FlightStack":
    from dst.vehicles.flight_stack import FlightStack  # noqa: PLC0415  # it loads JSBSim

    return FlightStack(scheduler, system, send, folder)
