"""How fast the link's bulk services are: a file at real time on loopback, a picture on a bad link.

The client is the plainest there is: a socket and a codec. What a ground station adds of its
own is not the vehicle's.
"""

import random
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from pymavlink.dialects.v20 import development as mavlink

from mavlink_broker.microservices.ftp_download import FileDownload
from mavlink_broker.microservices.ftp_requests import Fetched
from tests.bench.results import Result, at_most
from tests.conformance.ground_station import GroundStation, vehicle_process
from tests.support.file_air import FAR_AND_BAD, REMOTE, ROUTE, FileAir, a_file
from tests.support.file_client import FileClient, download
from tests.support.system import free_ports

SYSTEM: Final = 1
FILE_BYTES: Final = 1_000_000
PICTURE_BYTES: Final = 400_000
RUNS: Final = 5
_NAME: Final = "bench.bin"


def measure() -> Iterator[Result]:
    """Time burst reads of 1 MB."""
    own, broker, ground = free_ports(3)
    with tempfile.TemporaryDirectory() as folder:
        state = Path(folder)
        contents = random.Random(1).randbytes(FILE_BYTES)
        files = state / f"vehicle-{SYSTEM}" / "files"
        files.mkdir(parents=True)
        (files / _NAME).write_bytes(contents)
        with vehicle_process(SYSTEM, 1.0, (own, broker, ground), state):
            station = GroundStation(ground, own, SYSTEM)
            station.until(lambda m: m.get_type() == "HEARTBEAT", "the vehicle")
            times_s = [_burst_read_s(station, contents) for _ in range(RUNS)]
            station.close()
    yield at_most("MAVFTP burst read of 1 MB", sorted(times_s)[RUNS // 2], "s", 2.0, times_s)
    bad_s = [_picture_s(seed) for seed in range(RUNS)]
    name = "Picture of 400 kB at 20 % loss and 0.3 s each way, simulated"
    yield at_most(name, max(bad_s), "s", 60.0, bad_s)


def _picture_s(seed: int) -> float:
    """Simulated time [s] in which the broker fetches a picture over a bad link."""
    with tempfile.TemporaryDirectory() as folder:
        contents = a_file(Path(folder), PICTURE_BYTES, seed)
        air = FileAir(Path(folder), FAR_AND_BAD, seed)
        outcome = air.fetch(FileDownload(REMOTE, ROUTE, limit_bytes=2 * PICTURE_BYTES))
        if outcome != Fetched(contents):
            raise RuntimeError("what came is not what was sent")
        return air.now_s


def _burst_read_s(station: GroundStation, contents: bytes) -> float:
    """Time [s] from the first request to the end of the session."""
    received = bytearray()
    client = FileClient(download(f"/fs/microsd/{_NAME}", received))
    started = time.monotonic()
    _say(station, client.start(_now_us()))
    while not client.done:
        for message in station.hear():
            if message.get_type() == "FILE_TRANSFER_PROTOCOL":
                _say(station, client.take(bytes(message.payload), _now_us()))
        _say(station, client.tick(_now_us()))
    taken = time.monotonic() - started
    if received != contents:
        raise RuntimeError("what came is not what was sent")
    return taken


def _say(station: GroundStation, payloads: list[bytes]) -> None:
    for payload in payloads:
        station.say(mavlink.MAVLink_file_transfer_protocol_message(0, SYSTEM, 1, payload))


def _now_us() -> int:
    return time.monotonic_ns() // 1000
