"""How fast a fast client uploads a mission to a vehicle process at SPEED=1 over loopback.

The client answers each request in the same breath with an item packed beforehand, so that what
is measured is the vehicle: the time from MISSION_COUNT to the final MISSION_ACK, with the
judgement of the whole plan and its way to the disk.
"""

import socket
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from pymavlink.dialects.v20 import common

from tests.bench.results import Result, at_most, percentile
from tests.conformance.ground_station import vehicle_process
from tests.support.system import free_ports

RUNS: Final = 20
SIZES: Final = {500: 0.25, 1000: 0.5}
"""Number of items, and the time [s] that they may take."""
SYSTEM_ID: Final = 1
REQUEST_INT, ACK, ITEM_INT = 51, 47, 73
_HEADER: Final = 10
_PATIENCE_S: Final = 30.0


class TightClient:
    """A ground station that does nothing but answer."""

    def __init__(self, own_port: int, vehicle_port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", own_port))
        self._socket.settimeout(_PATIENCE_S)
        self._socket.connect(("127.0.0.1", vehicle_port))
        self._codec = common.MAVLink(None, srcSystem=255, srcComponent=190)

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()

    def wait_for_vehicle(self) -> None:
        """Wait for the vehicle's first message."""
        self._socket.recv(1000)

    def upload(self, count: int, height_m: float) -> float:
        """Upload waypoints; gives the time [s] from the count to the vehicle's acceptance."""
        frames = [self._framed(_waypoint(seq, height_m)) for seq in range(count)]
        opening = self._framed(common.MAVLink_mission_count_message(SYSTEM_ID, 1, count, 0))
        self._drain()
        started = time.perf_counter()
        self._socket.send(opening)
        while (datagram := self._socket.recv(1000))[7] != ACK or datagram[8]:
            if datagram[7] == REQUEST_INT and not datagram[8]:
                self._socket.send(frames[int.from_bytes(datagram[_HEADER : _HEADER + 2], "little")])
        took_s = time.perf_counter() - started
        ack = self._codec.decode(bytearray(datagram))
        if ack.type != common.MAV_MISSION_ACCEPTED:
            raise RuntimeError(f"the vehicle refused the mission: {ack}")
        return took_s

    def _framed(self, message: Any) -> bytes:
        datagram = bytes(message.pack(self._codec))
        self._codec.seq = (self._codec.seq + 1) % 256
        return datagram

    def _drain(self) -> None:
        """Forget the telemetry that has come in the meantime."""
        self._socket.setblocking(False)
        try:
            while self._socket.recv(1000):
                pass
        except BlockingIOError:
            pass
        self._socket.settimeout(_PATIENCE_S)


def _waypoint(seq: int, height_m: float) -> Any:
    place = (404_434_000 + 50 * (seq % 40), -37_382_000 + 50 * (seq // 40), height_m)
    return common.MAVLink_mission_item_int_message(
        SYSTEM_ID, 1, seq, 6, 16, 0, 1, 0.0, 1.0, 0.0, 0.0, *place, 0
    )


def measure() -> Iterator[Result]:
    """Upload missions of each size, over and over."""
    own, broker, ground = free_ports(3)
    with tempfile.TemporaryDirectory() as folder:
        client = TightClient(ground, own)
        with vehicle_process(SYSTEM_ID, 1.0, (own, broker, ground), Path(folder)):
            try:
                client.wait_for_vehicle()
                yield from _sizes(client)
            finally:
                client.close()


def _sizes(client: TightClient) -> Iterator[Result]:
    for count, bar_s in SIZES.items():
        times = [client.upload(count, height_m=10.0 + run) for run in range(RUNS)]
        name = f"upload of {count} items, p50"
        yield at_most(name, percentile(times, 50), "s", bar_s, times)
