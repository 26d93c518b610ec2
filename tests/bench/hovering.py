"""A whole vehicle in steady flight, its telemetry going to two peers over real sockets."""

import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from mavlink_broker.config import DEFAULT_SYSTEM_ID
from mavlink_broker.mavlink.dialect import Route, mavlink
from mavlink_broker.microservices.message_rates import STREAMS, UNREAD, set_interval
from sim.config import SimulationConfig
from tests.support.autopilot_tester import SYSTEM_ID, AutopilotTester
from tests.support.ground_station import ADDRESS, MemoryLink
from uav_firmware.cal.link import Address
from uav_firmware.drivers.log_folder import LogFolder
from uav_firmware.drivers.udp_link import UdpLink
from uav_firmware.modules.mavlink.wire.peers import Peer, Profile

_BROKER: Final[Address] = ("192.0.2.1", 14540)
_LOOPBACK: Final = "127.0.0.1"
_HEIGHT_M: Final = 5.0
_CLIMB_S: Final = 5.0


class TwoPeerLink(MemoryLink):
    """The operator's in-memory link, which also puts every datagram on the wire.

    The broker says what is in `from_broker`.

    Nobody reads the sinks: once their buffers are full the kernel drops what comes, and the
    vehicle has paid for sending it all the same.
    """

    def __init__(self, udp: UdpLink, sinks: dict[Address, Address]) -> None:
        super().__init__()
        self._udp = udp
        self._sinks = sinks
        self.from_broker: list[bytes] = []

    def receive(self) -> Sequence[tuple[bytes, Address]]:
        """What operator and broker have sent since the last call."""
        datagrams = [(datagram, _BROKER) for datagram in self.from_broker]
        self.from_broker.clear()
        return [*datagrams, *super().receive()]

    def send(self, datagram: bytes, address: Address) -> None:
        """Send to the peer's sink, and let the operator hear what is for the ground station."""
        self._udp.send(datagram, self._sinks[address])
        if address == ADDRESS:
            self.from_vehicle.append(datagram)


@contextmanager
def hovering_vehicle(seed: int, folder: Path, *, broker: bool = True) -> Iterator[AutopilotTester]:
    """Give a vehicle that hovers at 5 m, logs its flight and talks to broker and operator.

    The broker asks for the rates that it wants and turns off what it does not read, as it does
    in the running system. Without a `broker` PX4's onboard rates go to its address.
    """
    udp = UdpLink(_LOOPBACK, 0)
    sinks = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    try:
        for sink in sinks:
            sink.bind((_LOOPBACK, 0))
        routes = dict(zip((_BROKER, ADDRESS), [s.getsockname() for s in sinks], strict=True))
        link = TwoPeerLink(udp, routes)
        tester = AutopilotTester(
            SimulationConfig(seed=seed, gps="rtk"),
            folder,
            link=link,
            peers=(
                Peer(address=_BROKER, profile=Profile.ONBOARD),
                Peer(address=ADDRESS, profile=Profile.GROUND_STATION),
            ),
            log_store=LogFolder(folder / "log"),
        )
        if broker:
            link.from_broker = _requests()
        tester.wait_until_ready()
        tester.take_off(_HEIGHT_M)
        tester.run_for(_CLIMB_S)
        yield tester
        tester.autopilot.logger.close()
    finally:
        udp.close()
        for sink in sinks:
            sink.close()


def _requests() -> list[bytes]:
    """What the broker asks of a vehicle's streams."""
    route = Route(
        DEFAULT_SYSTEM_ID,
        mavlink.MAV_COMP_ID_ONBOARD_COMPUTER,
        SYSTEM_ID,
        mavlink.MAV_COMP_ID_AUTOPILOT1,
    )
    codec = mavlink.MAVLink(None, route.own_system, route.own_component)
    requests = [
        *(stream.request for stream in STREAMS),
        *(set_interval(message_id, -1.0) for message_id in UNREAD.values()),
    ]
    return [request.message(route, 0).pack(codec) for request in requests]


def fly_on(tester: AutopilotTester, seconds: int) -> None:
    """Let vehicle time pass; the operator, who is no part of the vehicle, looks once a second."""
    step = tester.autopilot.scheduler.step
    for _ in range(seconds):
        tester.ground_station.heartbeat()
        for _ in range(1_000_000 // tester.autopilot.vehicle.step_us):
            step()
        tester.ground_station.receive()
