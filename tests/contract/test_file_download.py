"""The broker's download and the vehicle's file server, over links that do their worst.

Time is simulated. What arrives must be what the vehicle has, byte for byte, and a vehicle that is
restarted in the middle costs no more than the time it is away.
"""

from pathlib import Path

import pytest

from mavlink_broker.microservices.ftp_download import FileDownload
from mavlink_broker.microservices.ftp_requests import Fetched, NotFetched
from tests.support.file_air import FAR_AND_BAD, REMOTE, ROUTE, a_file
from tests.support.file_air import FileAir as Air
from tests.support.lossy_link import Conditions

pytestmark = pytest.mark.usefixtures("no_open_files")

TROUBLES = {
    "clean": Conditions(),
    "loss": Conditions(loss=0.2),
    "duplicates": Conditions(duplication=0.3),
    "reordered": Conditions(reordering=0.3, hold_us=60_000),
    "far": Conditions(delay_us=750_000, loss=0.05),
    "all": Conditions(loss=0.2, duplication=0.2, reordering=0.2, delay_us=50_000),
}


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


@pytest.mark.first_case
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_picture_comes_within_a_minute_at_20_percent_loss_and_far_away(
    tmp_path: Path, seed: int
) -> None:
    """400 kB, 20 % loss and 0.3 s in each direction, a tenth of the frames reordered."""
    contents = a_file(tmp_path, 400_000, seed)
    air = Air(tmp_path, FAR_AND_BAD, seed)
    assert air.fetch(FileDownload(REMOTE, ROUTE, limit_bytes=10**6)) == Fetched(contents)
    assert air.now_s <= 60.0
    assert air.link.carried < 4 * len(contents) / 239  # Little is asked for twice in vain


@pytest.mark.thorough
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


def test_a_missing_file_is_reported_as_missing(tmp_path: Path) -> None:
    outcome = Air(tmp_path, TROUBLES["loss"]).fetch(FileDownload(REMOTE, ROUTE, limit_bytes=10**6))
    assert outcome == NotFetched("the vehicle answers: file not found")


def test_a_file_beyond_the_limit_is_not_begun(tmp_path: Path) -> None:
    a_file(tmp_path, 50_000)
    air = Air(tmp_path, Conditions())
    outcome = air.fetch(FileDownload(REMOTE, ROUTE, limit_bytes=49_999))
    assert outcome == NotFetched("it has 50000 bytes, and 49999 are the limit")
    assert air.link.carried < 30
