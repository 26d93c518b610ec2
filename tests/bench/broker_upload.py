"""How fast the broker puts a mission onto a vehicle process at SPEED=1, proved, over loopback.

The broker's own protocols and codec, and every message that the vehicle sends meanwhile; the
vehicle judges the plan and writes it to the disk. Proved by the vehicle's id of the plan, and
once more by reading every item back. Then the upload alone by the whole broker, its loop, session
and links: how long it takes, and what of that the broker's own work is. The rest is the vehicle's,
and the wait of both for a processor, 1,400 times: on a busy machine that is most of it.
"""

import socket
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import count
from pathlib import Path
from typing import Any, Final

from mavlink_broker.app import App
from mavlink_broker.autopilots.families import OWN
from mavlink_broker.cli.program import SystemClock
from mavlink_broker.config import Config
from mavlink_broker.links.hub import open_links
from mavlink_broker.links.url import parse_links
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, Route, mavlink
from mavlink_broker.mavlink.mission_item import waypoint
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.mission_download import MissionVerify, Verified
from mavlink_broker.microservices.mission_upload import MissionUpload, Stored
from mavlink_broker.mission.exchanges import difference
from mavlink_broker.mission.states import State
from mavlink_broker.planning.mission import FlightPlan
from mavlink_broker.vehicle.vehicle import Vehicle
from tests.bench.results import Result, at_most, percentile
from tests.conformance.ground_station import vehicle_process
from tests.support.fake_edge import FakeEdge
from tests.support.system import free_ports

RUNS: Final = 10
ITEMS: Final = 500
BAR_S: Final = 1.0
BROKER_RUNS: Final = 3
WORK_BAR_MS: Final = 0.4
"""Processor time of the whole broker for an item."""
SYSTEM_ID: Final = 1
ROUTE: Final = Route(254, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER, SYSTEM_ID, 1)
_PATIENCE_S: Final = 60.0
_TICK_S: Final = 0.02


class BrokerClient:
    """The broker's protocols on a socket."""

    def __init__(self, own_port: int, vehicle_port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", own_port))
        self._socket.connect(("127.0.0.1", vehicle_port))
        self._socket.settimeout(_PATIENCE_S)
        self._socket.recv(2000)  # The vehicle is there
        self._socket.settimeout(_TICK_S)
        self._encoder = Encoder(ROUTE.own_system, ROUTE.own_component)
        self._decoder = Decoder()
        self._round_trip = RoundTrip()

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()

    def upload(self, plan: FlightPlan) -> int:
        """Put a plan onto the vehicle; gives its id."""
        items = plan.messages(SYSTEM_ID, 1)
        upload = MissionUpload(items, ROUTE, self._round_trip, busy_pause_s=OWN.busy_pause_s)
        self._run(upload)
        match upload.outcome:
            case Stored(opaque_id):
                return opaque_id
            case outcome:
                raise RuntimeError(f"the mission is not on the vehicle: {outcome}")

    def prove(self, plan: FlightPlan, opaque_id: int) -> None:
        """Have the vehicle prove that it holds a plan: by its id, or with 0 by all its items."""

        def compare(held: Sequence[Message]) -> str | None:
            return difference(plan, held, OWN)

        verify = MissionVerify(opaque_id, compare, ROUTE, self._round_trip)
        self._run(verify)
        if verify.outcome != Verified():
            raise RuntimeError(f"the mission is not proved: {verify.outcome}")

    def _run(self, activity: MissionUpload | MissionVerify) -> None:
        end = time.monotonic() + _PATIENCE_S
        self._send(activity.start(time.monotonic()))
        while activity.outcome is None:
            now = time.monotonic()
            if now > end:
                raise TimeoutError("the transfer has no end")
            for message in self._receive():
                self._send(activity.receive(message, now))
            self._send(activity.tick(now))

    def _receive(self) -> Sequence[Message]:
        try:
            return self._decoder.decode(self._socket.recv(2000))
        except TimeoutError:
            return ()

    def _send(self, messages: Sequence[Message]) -> None:
        for message in messages:
            self._socket.send(self._encoder.encode(message))


def a_plan(height_m: float) -> FlightPlan:
    """Waypoints in rows."""
    items = tuple(
        waypoint(
            latitude_deg=40.4434 + 5e-6 * (seq % 40),
            longitude_deg=-3.7382 + 5e-6 * (seq // 40),
            relative_altitude_m=height_m,
            acceptance_radius_m=1.0,
        )
        for seq in range(ITEMS)
    )
    owners = tuple(range(ITEMS))
    return FlightPlan(
        items=items,
        command_of_item=owners,
        done_item=owners,
        notes=((),) * ITEMS,
        first_item=0,
        ends_on_ground=False,
    )


def measure() -> Iterator[Result]:
    """Upload and prove missions, over and over."""
    own, broker, ground = free_ports(3)
    with (
        tempfile.TemporaryDirectory() as folder,
        vehicle_process(SYSTEM_ID, 1.0, (own, broker, ground), Path(folder)),
    ):
        client = BrokerClient(broker, own)
        try:
            yield from _times(client)
        finally:
            client.close()
        uploads = [_by_the_broker(broker, 50.0 + run) for run in range(BROKER_RUNS)]
        took_s, worked_ms = [wall_s for wall_s, _ in uploads], [work_ms for _, work_ms in uploads]
        name = f"mission of {ITEMS} items onto the vehicle by the whole broker, p50"
        yield at_most(name, percentile(took_s, 50), "s", BAR_S, took_s)
        name = "processor time of the whole broker per item of a mission, p50"
        yield at_most(name, percentile(worked_ms, 50), "ms", WORK_BAR_MS, worked_ms)


def _by_the_broker(port: int, height_m: float) -> tuple[float, float]:
    """Have the whole broker upload a mission, which is not flown.

    Gives how long it took [s], and the broker's own processor time per item [ms].
    """
    link = open_links(parse_links(f"udpin://127.0.0.1:{port}"))
    edge = FakeEdge()
    numbers = (f"01{number:024d}" for number in count(1))
    app = App(Config(), link, edge, SystemClock(), lambda: next(numbers))
    try:
        _run_until(app, lambda _, vehicle: vehicle.ready_to_arm is True)
        edge.plan(_survey(height_m))
        _run_until(app, lambda state, _: state is State.UPLOADING)
        started, worked = time.perf_counter(), time.process_time()
        _run_until(app, lambda state, _: state is not State.UPLOADING)
        work_s = time.process_time() - worked
        return time.perf_counter() - started, 1e3 * work_s / ITEMS
    finally:
        app.close()
        link.close()


def _run_until(app: App, condition: Callable[[State, Vehicle], bool]) -> None:
    end = time.monotonic() + _PATIENCE_S
    while time.monotonic() < end:
        session = app.sessions.get(SYSTEM_ID)
        if session is not None and condition(session.state, session.vehicle):
            return
        app.step()
    raise TimeoutError("the broker does not come to it")


def _survey(height_m: float) -> dict[str, Any]:
    """The mission that becomes as many items, but for a handful."""
    places = [
        {
            "latitude": 40.4434 + 5e-6 * (number % 40),
            "longitude": -3.7382 + 5e-6 * (number // 40),
            "altitude": height_m,
        }
        for number in range(ITEMS)
    ]
    kinds = [1] + [3] * (ITEMS - 1)
    commands = [
        {"command_id": number, "command_type_id": kind, "parameters": place}
        for number, (kind, place) in enumerate(zip(kinds, places, strict=True), 1)
    ]
    return {
        "mission_id": round(height_m),
        "vehicle_id": SYSTEM_ID,
        "maximum_speed": 4.0,
        "command_array": commands,
    }


def _times(client: BrokerClient) -> Iterator[Result]:
    by_id, read_back = [], []
    for run in range(RUNS):
        plan = a_plan(10.0 + run)
        started = time.perf_counter()
        opaque_id = client.upload(plan)
        client.prove(plan, opaque_id)
        proved = time.perf_counter()
        client.prove(plan, 0)
        by_id.append(proved - started)
        read_back.append(time.perf_counter() - proved)
    name = f"mission of {ITEMS} items on the vehicle and verified by the broker, p50"
    yield at_most(name, percentile(by_id, 50), "s", BAR_S, by_id)
    name = f"mission of {ITEMS} items read back and compared by the broker, p50"
    yield at_most(name, percentile(read_back, 50), "s", BAR_S, read_back)
