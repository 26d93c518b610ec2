"""The broker's download and the vehicle's file server, over links that do their worst.

Time is simulated. What arrives must be what the vehicle has, byte for byte, and a vehicle that is
restarted in the middle costs no more than the time it is away.
"""

import random
from pathlib import Path

import pytest

from mavlink_broker.codec import Decoder, Encoder
from mavlink_broker.dialect import Message, mavlink
from mavlink_broker.protocol.file_download import FileDownload
from mavlink_broker.protocol.partial_file import Fetched, FetchOutcome, NotFetched
from mavlink_broker.protocol.route import Route
from tests.support.lossy_link import VEHICLE_ADDRESS, Conditions, LossyLink
from tests.unit.uav_firmware.modules.mavlink.harness import SYSTEM, empty_topics, judged_by
from uav_firmware.cal.files import Card
from uav_firmware.drivers.file_tree import FileTree
from uav_firmware.modules.mavlink.module import MavlinkModule
from uav_firmware.parameters import Registry

STEP_S = 0.004
PATIENCE_S = 600.0
REMOTE = "/fs/microsd/picture.jpg"
ROUTE = Route(own_system=254, own_component=191, target_system=SYSTEM, target_component=1)
TROUBLES = {
    "clean": Conditions(),
    "loss": Conditions(loss=0.2),
    "duplicates": Conditions(duplication=0.3),
    "reordered": Conditions(reordering=0.3, hold_us=60_000),
    "far": Conditions(delay_us=750_000, loss=0.05),
    "all": Conditions(loss=0.2, duplication=0.2, reordering=0.2, delay_us=50_000),
}


class Air:
    """A MAVLink module on one end of the link, a download on the other."""

    def __init__(self, folder: Path, conditions: Conditions, seed: int = 1) -> None:
        self.folder = folder
        self.link = LossyLink(conditions, conditions, seed=seed)
        self.now_s = 0.0
        self.module = self._boot()
        self._started: list[FileDownload] = []
        self._encoder = Encoder(254, 191)
        self._decoder = Decoder()

    def _boot(self) -> MavlinkModule:
        tree = FileTree(self.folder)
        return MavlinkModule(
            link=self.link.vehicle,
            system_id=SYSTEM,
            registry=Registry(),
            topics=empty_topics(),
            checks=judged_by(lambda _: None),
            peers=(),
            card=Card(tree, FileTree(self.folder / "log"), FileTree(self.folder / "image")),
        )

    def reboot(self) -> None:
        """Forget everything but the card."""
        self.module = self._boot()

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
        self.module.update(now_us)
        for datagram, _ in self.link.ground.receive():
            for message in self._decoder.decode(datagram):
                self._send(download.receive(message, self.now_s))
        self._send(download.tick(self.now_s))

    def _send(self, messages: list[Message]) -> None:
        for message in messages:
            self.link.ground.send(self._encoder.encode(message), VEHICLE_ADDRESS)


def a_file(folder: Path, size: int, seed: int = 1) -> bytes:
    contents = random.Random(seed).randbytes(size)
    (folder / "picture.jpg").write_bytes(contents)
    return contents


@pytest.mark.parametrize("trouble", TROUBLES)
def test_a_file_comes_whole_whatever_the_link_does(tmp_path: Path, trouble: str) -> None:
    contents = a_file(tmp_path, 60_000)
    air = Air(tmp_path, TROUBLES[trouble])
    assert air.fetch(FileDownload(REMOTE, ROUTE, limit_bytes=10**6)) == Fetched(contents)


def test_transfers_follow_each_other_on_one_link(tmp_path: Path) -> None:
    air, seq = Air(tmp_path, TROUBLES["loss"]), 65_500
    for seed, size in enumerate((1, 238, 239, 240, 5_000)):
        contents = a_file(tmp_path, size, seed)
        download = FileDownload(REMOTE, ROUTE, limit_bytes=10**6, first_seq=seq)
        assert air.fetch(download) == Fetched(contents)
        seq = download.next_seq


def test_a_restarted_vehicle_is_asked_on_where_it_stopped(tmp_path: Path) -> None:
    contents = a_file(tmp_path, 200_000)
    air = Air(tmp_path, Conditions(delay_us=20_000))
    whole_s = Air(tmp_path, Conditions(delay_us=20_000))
    whole_s.fetch(FileDownload(REMOTE, ROUTE, limit_bytes=10**6))
    download = FileDownload(REMOTE, ROUTE, limit_bytes=10**6)
    carried = whole_s.link.carried
    assert air.fetch(download, reboot_after_s=whole_s.now_s / 2) == Fetched(contents)
    assert air.link.carried < 1.5 * carried


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_picture_comes_within_a_minute_at_20_percent_loss_and_far_away(
    tmp_path: Path, seed: int
) -> None:
    """400 kB, 20 % loss and 0.3 s each way, a tenth of the frames overtaken."""
    bad = Conditions(loss=0.2, delay_us=300_000, reordering=0.1, hold_us=100_000)
    contents = a_file(tmp_path, 400_000, seed)
    air = Air(tmp_path, bad, seed)
    assert air.fetch(FileDownload(REMOTE, ROUTE, limit_bytes=10**6)) == Fetched(contents)
    assert air.now_s <= 60.0
    assert air.link.carried < 4 * len(contents) / 239  # Little is asked for twice in vain


def test_a_transfer_goes_on_where_an_outage_has_ended_the_one_before(tmp_path: Path) -> None:
    contents = a_file(tmp_path, 400_000)
    bad, gone = Conditions(loss=0.2, delay_us=100_000), Conditions(loss=1.0)
    air, partial, brought = Air(tmp_path, bad), None, []
    for share in (0.2, 0.4, 0.6):
        air.link.degrade(bad, bad)
        download = FileDownload(REMOTE, ROUTE, limit_bytes=10**6, partial=partial)
        while download.partial.received < share * len(contents):
            assert air.fetch(download, until_s=air.now_s + 0.1) is None
        air.link.degrade(gone, gone)
        assert air.fetch(download) == NotFetched("the vehicle does not answer")
        partial = download.partial
        brought.append(partial.received)
    assert 0 < brought[0] < brought[1] < brought[2] < len(contents)
    air.link.degrade(bad, bad)
    before = air.link.carried
    download = FileDownload(REMOTE, ROUTE, limit_bytes=10**6, partial=partial)
    assert air.fetch(download) == Fetched(contents)
    assert air.link.carried - before < 3 * (len(contents) - brought[2]) / 239 + 200


def test_what_an_earlier_transfer_brought_of_another_file_is_not_mixed_in(tmp_path: Path) -> None:
    a_file(tmp_path, 100_000, seed=1)
    air = Air(tmp_path, Conditions(delay_us=50_000))
    download = FileDownload(REMOTE, ROUTE, limit_bytes=10**6)
    assert air.fetch(download, until_s=1.35) is None
    assert download.partial.received > 0
    contents = a_file(tmp_path, 100_000, seed=2)
    after = FileDownload(REMOTE, ROUTE, limit_bytes=10**6, partial=download.partial)
    air.reboot()
    assert air.fetch(after) == Fetched(contents)


def test_what_is_not_there_is_said_so(tmp_path: Path) -> None:
    outcome = Air(tmp_path, TROUBLES["loss"]).fetch(FileDownload(REMOTE, ROUTE, limit_bytes=10**6))
    assert outcome == NotFetched("the vehicle answers: file not found")


def test_a_file_beyond_the_limit_is_not_begun(tmp_path: Path) -> None:
    a_file(tmp_path, 50_000)
    air = Air(tmp_path, Conditions())
    outcome = air.fetch(FileDownload(REMOTE, ROUTE, limit_bytes=49_999))
    assert outcome == NotFetched("it has 50000 bytes, and 49999 are the limit")
    assert air.link.carried < 30
