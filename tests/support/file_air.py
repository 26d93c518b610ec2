"""The broker's file download at one end of a bad link, the vehicle's file server at the other.

Time is simulated.
"""

import random
from pathlib import Path
from typing import Final

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, Route, mavlink
from mavlink_broker.microservices.ftp_download import FileDownload
from mavlink_broker.microservices.ftp_requests import FetchOutcome
from tests.support.lossy_link import VEHICLE_ADDRESS, Conditions, LossyLink
from tests.unit.uav_firmware.modules.mavlink.harness import SYSTEM, empty_topics
from uav_firmware.cal.files import Card
from uav_firmware.drivers.file_tree import FileTree
from uav_firmware.modules.mavlink.module import MavlinkModule
from uav_firmware.parameters import Registry

STEP_S: Final = 0.004
PATIENCE_S: Final = 600.0
REMOTE: Final = "/fs/microsd/picture.jpg"
ROUTE: Final = Route(own_system=254, own_component=191, target_system=SYSTEM, target_component=1)
FAR_AND_BAD: Final = Conditions(loss=0.2, delay_us=300_000, reordering=0.1, hold_us=100_000)
"""20 % loss and 0.3 s in each direction, a tenth of the frames overtaken."""


def module_at(link: LossyLink, folder: Path) -> MavlinkModule:
    """Start the module of a vehicle on its end of a link, with a folder as its card."""
    return MavlinkModule(
        link=link.vehicle,
        system_id=SYSTEM,
        registry=Registry(),
        topics=empty_topics(),
        peers=(),
        card=Card(FileTree(folder), FileTree(folder / "log"), FileTree(folder / "image")),
    )


class FileAir:
    """A MAVLink module on one end of the link, a download on the other."""

    def __init__(self, folder: Path, conditions: Conditions, seed: int = 1) -> None:
        self.folder = folder
        self.link = LossyLink(conditions, conditions, seed=seed)
        self.now_s = 0.0
        self.module = module_at(self.link, folder)
        self._started: list[FileDownload] = []
        self._encoder = Encoder(254, 191)
        self._decoder = Decoder()

    def reboot(self) -> None:
        """Forget everything but the card."""
        self.module = module_at(self.link, self.folder)

    def fetch(
        self,
        download: FileDownload,
        *,
        reboot_after_s: float = PATIENCE_S,
        until_s: float = float("inf"),
    ) -> FetchOutcome | None:
        """Let the download come to its end, or to a time; to be called again to go on."""
        if download not in self._started:
            self._started.append(download)
            self._send(download.start(self.now_s))
        reboot_at, end = self.now_s + reboot_after_s, self.now_s + PATIENCE_S
        while download.outcome is None and self.now_s < until_s:
            assert self.now_s < end
            if self.now_s >= reboot_at:
                reboot_at = end
                self.reboot()
            self._step(download)
        return download.outcome

    def _step(self, download: FileDownload) -> None:
        self.now_s += STEP_S
        now_us = round(self.now_s * 1e6)
        if now_us % 500_000 < STEP_S * 1e6:
            self._send([mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)])
        self.link.advance(now_us)
        self.module.serve(now_us)
        self.module.update(now_us)
        for datagram, _ in self.link.ground.receive():
            for message in self._decoder.decode(datagram):
                self._send(download.receive(message, self.now_s))
        self._send(download.tick(self.now_s))

    def _send(self, messages: list[Message]) -> None:
        for message in messages:
            self.link.ground.send(self._encoder.encode(message), VEHICLE_ADDRESS)


def a_file(folder: Path, size: int, seed: int = 1) -> bytes:
    """Put a file onto the card; gives its contents."""
    contents = random.Random(seed).randbytes(size)
    (folder / "picture.jpg").write_bytes(contents)
    return contents
