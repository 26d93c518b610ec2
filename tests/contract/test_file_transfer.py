"""The vehicle's file server and an independent client, over links that do their worst.

Time is simulated. What arrives must be what was sent, byte for byte.
"""

import random
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from tests.support.file_client import FileClient, Steps, download, upload
from tests.support.lossy_link import VEHICLE_ADDRESS, Conditions, LossyLink
from tests.unit.uav_firmware.modules.mavlink.harness import SYSTEM, empty_topics
from uav_firmware.cal.files import Card
from uav_firmware.drivers.file_tree import FileTree
from uav_firmware.modules.mavlink.module import MavlinkModule
from uav_firmware.parameters import Registry

STEP_US = 4_000
PATIENCE_US = 600_000_000
REMOTE = "/fs/microsd/file.bin"
TROUBLES = {
    "clean": Conditions(),
    "loss": Conditions(loss=0.2),
    "duplicates": Conditions(duplication=0.3),
    "reordered": Conditions(reordering=0.3, hold_us=60_000),
    "far": Conditions(delay_us=750_000, loss=0.05),
    "all": Conditions(loss=0.2, duplication=0.2, reordering=0.2, delay_us=50_000),
}


class Air:
    """A MAVLink module on one end of the link, a client on the other."""

    def __init__(self, folder: Path, conditions: Conditions, seed: int) -> None:
        self.link = LossyLink(conditions, conditions, seed=seed)
        tree = FileTree(folder)
        self.module = MavlinkModule(
            link=self.link.vehicle,
            system_id=SYSTEM,
            registry=Registry(),
            topics=empty_topics(),
            peers=(),
            card=Card(tree, FileTree(folder / "log"), FileTree(folder / "image")),
        )
        self.now_us = 0
        self._codec = common.MAVLink(None, srcSystem=255, srcComponent=190)
        self._codec.robust_parsing = True

    def carry_out(self, steps: Steps) -> None:
        client = FileClient(steps)
        self._send(client.start(self.now_us))
        end_us = self.now_us + PATIENCE_US
        while not client.done:
            assert self.now_us < end_us
            self._step(client)

    def _step(self, client: FileClient) -> None:
        if self.now_us % 500_000 == 0:
            heartbeat = common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
            self.link.ground.send(heartbeat.pack(self._codec), VEHICLE_ADDRESS)
        self.now_us += STEP_US
        self.link.advance(self.now_us)
        self.module.serve(self.now_us)
        self.module.update(self.now_us)
        for datagram, _ in self.link.ground.receive():
            for message in self._codec.parse_buffer(datagram) or []:
                if message.get_type() == "FILE_TRANSFER_PROTOCOL":
                    self._send(client.take(bytes(message.payload), self.now_us))
        self._send(client.tick(self.now_us))

    def _send(self, payloads: list[bytes]) -> None:
        for payload in payloads:
            message = common.MAVLink_file_transfer_protocol_message(0, SYSTEM, 1, payload)
            self.link.ground.send(message.pack(self._codec), VEHICLE_ADDRESS)


@pytest.mark.first_case
@pytest.mark.parametrize("trouble", TROUBLES)
@pytest.mark.parametrize("seed", range(3))
def test_a_file_goes_up_and_comes_back_right(tmp_path: Path, trouble: str, seed: int) -> None:
    contents = random.Random(seed).randbytes(20_000 + seed)
    air = Air(tmp_path, TROUBLES[trouble], seed)
    air.carry_out(upload(REMOTE, contents))
    assert (tmp_path / "file.bin").read_bytes() == contents
    back = bytearray()
    air.carry_out(download(REMOTE, back))
    assert bytes(back) == contents
