"""A state folder on a file system that is read-only for a while."""

import logging
from pathlib import Path

import pytest

from edge_server.store.files.read_only import LOG_INTERVAL_S, is_read_only, wait_until_writable


class Disk:
    """Read-only until it is remounted; the program is stopped before, or not."""

    def __init__(self, remounted_at_s: float, stopped_at_s: float = 1e9) -> None:
        self.now_s = 0.0
        self._remounted_at_s, self._stopped_at_s = remounted_at_s, stopped_at_s

    def is_read_only(self, _: Path) -> bool:
        return self.now_s < self._remounted_at_s

    def wait(self, seconds: float) -> bool:
        self.now_s += seconds
        return self.now_s >= self._stopped_at_s


def test_it_is_waited_for_and_said_once_a_minute(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    disk = Disk(remounted_at_s=2.5 * LOG_INTERVAL_S)
    with caplog.at_level(logging.WARNING):
        wait_until_writable(tmp_path, disk.wait, disk.is_read_only)
    assert disk.now_s == pytest.approx(2.5 * LOG_INTERVAL_S, abs=1.0)
    *waiting, last = caplog.messages
    assert len(waiting) == 3
    assert all(str(tmp_path) in one and "remount" in one for one in waiting)
    assert "writable again" in last


def test_a_program_that_is_stopped_waits_no_longer(tmp_path: Path) -> None:
    disk = Disk(remounted_at_s=1e9, stopped_at_s=3.0)
    wait_until_writable(tmp_path, disk.wait, disk.is_read_only)
    assert disk.now_s == pytest.approx(3.0)


def test_a_folder_that_can_be_written_to_is_not_waited_for(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    disk = Disk(remounted_at_s=0.0)
    wait_until_writable(tmp_path / "new", disk.wait, disk.is_read_only)
    assert (disk.now_s, caplog.messages) == (0.0, [])


def test_the_file_system_of_a_folder_that_is_not_made_yet_counts(tmp_path: Path) -> None:
    assert not is_read_only(tmp_path / "state" / "edge")
