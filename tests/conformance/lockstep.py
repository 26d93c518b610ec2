"""A ground station and a whole vehicle in one process, in lockstep: vehicle time is exact.

Nothing is paced and nothing listens on a socket, so that a busy machine makes no answer late.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from pymavlink.dialects.v20 import development as mavlink

from sim.config import SimulationConfig
from sim.simulation import Simulation
from uav_firmware.cal.link import Address
from uav_firmware.drivers.file_storage import FileStorage
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.module_errors import end_flight
from uav_firmware.modules.mavlink.wire.peers import Peer, Profile
from uav_firmware.topology import Autopilot

ADDRESS: Final[Address] = ("192.0.2.2", 14550)
SYSTEM, COMPONENT = 255, 190
_HEARTBEAT_US: Final = 1_000_000


class _Wire:
    """Datagrams in lists; implements `uav_firmware.cal.link.Link`."""

    def __init__(self) -> None:
        self.to_vehicle: list[tuple[bytes, Address]] = []
        self.from_vehicle: list[tuple[bytes, Address]] = []

    def receive(self) -> Sequence[tuple[bytes, Address]]:
        arrived, self.to_vehicle = self.to_vehicle, []
        return arrived

    def send(self, datagram: bytes, address: Address) -> None:
        self.from_vehicle.append((datagram, address))

    def refused_addresses(self) -> Sequence[Address]:
        """Somebody always listens."""
        return ()

    def close(self) -> None:
        pass


class Lockstep:
    """Says messages, lets vehicle time pass, hears messages."""

    def __init__(self, vehicle: int, folder: Path) -> None:
        self.vehicle = vehicle
        self._wire = _Wire()
        self._autopilot = Autopilot(
            JsbsimVehicle(Simulation(SimulationConfig(gps="rtk"))),
            self._wire,
            FileStorage(folder),
            system_id=vehicle,
            peers=(Peer(address=ADDRESS, profile=Profile.GROUND_STATION),),
            boot_time_utc_us=0,
            write_line=lambda _time_us, _text: None,
            on_error=end_flight,
        )
        self._codec = mavlink.MAVLink(None, SYSTEM, COMPONENT)
        self._codec.robust_parsing = True
        self._heartbeat_us = 0
        self.newest: dict[str, Any] = {}

    @property
    def now_s(self) -> float:
        """Vehicle time [s]."""
        return self._autopilot.vehicle.time_us * 1e-6

    def say(self, message: Any, source: Address = ADDRESS) -> None:
        self._wire.to_vehicle.append((message.pack(self._codec), source))
        self._codec.seq = (self._codec.seq + 1) % 256

    def step(self) -> list[Any]:
        """Run one control step; return what the autopilot sends to this station."""
        if self._autopilot.vehicle.time_us >= self._heartbeat_us:
            self._heartbeat_us += _HEARTBEAT_US
            self.say(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
        self._autopilot.scheduler.step()
        self._autopilot.serve_link()
        sent, self._wire.from_vehicle = self._wire.from_vehicle, []
        messages = [
            message
            for datagram, address in sent
            if address == ADDRESS
            for message in self._codec.parse_buffer(datagram) or []
            if message.get_type() != "BAD_DATA" and message.get_srcComponent() == 1
        ]
        self.newest |= {message.get_type(): message for message in messages}
        return messages

    def until(self, condition: Callable[[Any], Any], seconds: float, what: str) -> Any:
        """Let time pass until a message fulfils the condition, and give that message."""
        deadline_s = self.now_s + seconds
        while self.now_s < deadline_s:
            for message in self.step():
                if condition(message):
                    return message
        raise AssertionError(f"no {what} within {seconds} s of vehicle time")

    def run(self, seconds: float) -> list[Any]:
        """Return all messages received in this time."""
        end_s = self.now_s + seconds
        received: list[Any] = []
        while self.now_s < end_s:
            received += self.step()
        return received
