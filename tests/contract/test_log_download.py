"""The broker's client of the log protocol and the vehicle's server, over links that do their worst.

Time is simulated. What arrives must be what the vehicle has written, byte for byte.
"""

from pathlib import Path

import pytest

from mavlink_broker.microservices.log_download import NO_DATA, PART_BYTES, LogDownload, LogEntry
from tests.support.log_air import ROUTE, LogAir
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
def test_a_log_comes_whole_whatever_the_link_does(tmp_path: Path, trouble: str) -> None:
    air = LogAir(tmp_path, TROUBLES[trouble])
    air.write_log("08_00_00", 500, seed=2)
    contents = air.write_log("09_30_00", 40_000)
    first, second = air.list_logs()
    assert (first.size, second.size) == (500, 40_000)
    assert second.time_s - first.time_s == 5400
    assert air.fetch(LogDownload(second, ROUTE)) == contents


@pytest.mark.parametrize("size", [1, 89, 90, 91, PART_BYTES, PART_BYTES + 1])
def test_a_log_of_any_size_ends_where_it_ends(tmp_path: Path, size: int) -> None:
    air = LogAir(tmp_path, Conditions())
    contents = air.write_log("09_30_00", size)
    (entry,) = air.list_logs()
    assert air.fetch(LogDownload(entry, ROUTE)) == contents


def test_a_download_goes_on_at_an_offset(tmp_path: Path) -> None:
    air = LogAir(tmp_path, Conditions(loss=0.1))
    contents = air.write_log("09_30_00", 20_000)
    (entry,) = air.list_logs()
    assert air.fetch(LogDownload(entry, ROUTE, offset=12_345)) == contents[12_345:]
    assert air.fetch(LogDownload(entry, ROUTE, offset=20_000)) == b""


def test_all_of_many_logs_are_listed(tmp_path: Path) -> None:
    air = LogAir(tmp_path, Conditions(loss=0.3, reordering=0.2))
    for number in range(40):
        air.write_log(f"09_30_{number:02d}", 100 + number)
    assert [entry.size for entry in air.list_logs()] == [100 + number for number in range(40)]


def test_a_vehicle_without_logs_lists_none(tmp_path: Path) -> None:
    assert LogAir(tmp_path, Conditions(loss=0.2)).list_logs() == ()


def test_a_vehicle_that_is_gone_lists_none(tmp_path: Path) -> None:
    air = LogAir(tmp_path, Conditions(loss=1.0))
    assert air.list_logs() == ()
    assert air.now_s < 10.0


def test_a_vehicle_that_restarts_midway_is_asked_again(tmp_path: Path) -> None:
    air = LogAir(tmp_path, Conditions(delay_us=20_000))
    contents = air.write_log("09_30_00", 300_000)
    (entry,) = air.list_logs()
    assert air.fetch(LogDownload(entry, ROUTE), reboot_after_s=1.0) == contents


def test_a_log_that_grows_is_received_as_it_was_listed(tmp_path: Path) -> None:
    air = LogAir(tmp_path, Conditions())
    contents = air.write_log("09_30_00", 10_000)
    (entry,) = air.list_logs()
    with (tmp_path / "log/2026-03-01/09_30_00.ulg").open("ab") as log:
        log.write(b"more")
    assert air.fetch(LogDownload(entry, ROUTE)) == contents


def test_a_log_that_is_shorter_than_listed_ends_where_its_data_ends(tmp_path: Path) -> None:
    air = LogAir(tmp_path, Conditions(loss=0.1))
    contents = air.write_log("09_30_00", 10_000)
    (entry,) = air.list_logs()
    assert air.fetch(LogDownload(entry._replace(size=3 * PART_BYTES), ROUTE)) == contents
    assert (
        air.fetch(LogDownload(entry._replace(size=0xFFFFFFFF), ROUTE, offset=9999))
        == (contents[9999:])
    )


def test_a_log_that_does_not_exist_fails(tmp_path: Path) -> None:
    air = LogAir(tmp_path, Conditions())
    download = LogDownload(LogEntry(7, 0, 1000), ROUTE)
    assert air.fetch(download) == b""
    assert download.failure == NO_DATA
    assert air.now_s < 120.0


@pytest.mark.first_case
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_bad_link_far_away_costs_neither_minutes_nor_many_repetitions(
    tmp_path: Path, seed: int
) -> None:
    """300 kB, 20 % loss and 0.3 s in each direction, a tenth of the frames reordered."""
    bad = Conditions(loss=0.2, delay_us=300_000, reordering=0.1, hold_us=100_000)
    air = LogAir(tmp_path, bad, seed)
    contents = air.write_log("09_30_00", 300_000, seed)
    (entry,) = air.list_logs()
    assert air.fetch(LogDownload(entry, ROUTE)) == contents
    assert air.link.carried < 4 * len(contents) / 90
    assert air.now_s < 120.0


def test_the_rate_is_limited_and_the_link_has_pauses(tmp_path: Path) -> None:
    air = LogAir(tmp_path, Conditions())
    contents = air.write_log("09_30_00", 1_000_000)
    (entry,) = air.list_logs()
    began_s = air.now_s
    assert air.fetch(LogDownload(entry, ROUTE)) == contents
    assert 7.0 < air.now_s - began_s < 14.0
