"""A whole vehicle in steady flight, its telemetry going to two peers over real sockets."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from sim.config import SimulationConfig
from tests.support.autopilot_tester import AutopilotTester
from tests.support.ground_station import ADDRESS, MemoryLink
from uav_firmware.cal.link import Address
from uav_firmware.drivers.log_folder import LogFolder
from uav_firmware.drivers.udp_link import UdpLink
from uav_firmware.modules.mavlink.peers import Peer, Profile

_BROKER: Final[Address] = ("192.0.2.1", 14540)
_LOOPBACK: Final = "127.0.0.1"
_HEIGHT_M: Final = 5.0
_CLIMB_S: Final = 5.0


class TwoPeerLink(MemoryLink):
    """The operator's in-memory link, which also puts every datagram on the wire.

    Nobody reads the sinks: once their buffers are full the kernel drops what comes, and the
    vehicle has paid for sending it all the same.
    """

    def __init__(self, udp: UdpLink, sinks: dict[Address, Address]) -> None:
        super().__init__()
        self._udp = udp
        self._sinks = sinks

    def send(self, datagram: bytes, address: Address) -> None:
        """Send to the peer's sink, and let the operator hear what is for the ground station."""
        self._udp.send(datagram, self._sinks[address])
        if address == ADDRESS:
            self.from_vehicle.append(datagram)


@contextmanager
def hovering_vehicle(seed: int, folder: Path) -> Iterator[AutopilotTester]:
    """Give a vehicle that hovers at 5 m, logs its flight and talks to broker and operator."""
    udp = UdpLink(_LOOPBACK, 0)
    sinks = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    try:
        for sink in sinks:
            sink.bind((_LOOPBACK, 0))
        routes = dict(zip((_BROKER, ADDRESS), [s.getsockname() for s in sinks], strict=True))
        tester = AutopilotTester(
            SimulationConfig(seed=seed),
            folder,
            link=TwoPeerLink(udp, routes),
            peers=(
                Peer(address=_BROKER, profile=Profile.ONBOARD),
                Peer(address=ADDRESS, profile=Profile.GROUND_STATION),
            ),
            log_store=LogFolder(folder / "log"),
        )
        tester.wait_until_ready()
        tester.take_off(_HEIGHT_M)
        tester.run_for(_CLIMB_S)
        yield tester
        tester.autopilot.logger.close()
    finally:
        udp.close()
        for sink in sinks:
            sink.close()


def fly_on(tester: AutopilotTester, seconds: int) -> None:
    """Let vehicle time pass; the operator, who is no part of the vehicle, looks once a second."""
    step = tester.autopilot.scheduler.step
    for _ in range(seconds):
        tester.ground_station.heartbeat()
        for _ in range(1_000_000 // tester.autopilot.vehicle.step_us):
            step()
        tester.ground_station.hear()
