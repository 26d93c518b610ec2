"""A disk of the simulation keeps what was synced, and nothing else for sure."""

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path
from random import Random

import pytest

from dst.world.disk import BLOCK_BYTES, BLOCKS, Disk, StillOpenError, attached


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Disk]:
    disk = Disk(tmp_path, Random(1))
    with attached(disk):
        yield disk


def opened(disk: Disk, synchronous: str = "FULL") -> sqlite3.Connection:
    connection = sqlite3.connect(disk.folder / "test.db", isolation_level=None)
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute(f"PRAGMA synchronous={synchronous}")
    connection.execute("CREATE TABLE IF NOT EXISTS numbers (number INTEGER PRIMARY KEY, text TEXT)")
    return connection


def add(connection: sqlite3.Connection, numbers: range) -> None:
    for number in numbers:
        connection.execute("INSERT INTO numbers VALUES (?, ?)", (number, "x" * 900))


def numbers(disk: Disk) -> set[int]:
    with closing(opened(disk)) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        return {number for (number,) in connection.execute("SELECT number FROM numbers")}


def lose_power(disk: Disk, connection: sqlite3.Connection) -> int:
    disk.lose_power()
    connection.close()
    return disk.restore_power()


def test_its_size_is_not_that_of_the_machine_that_simulates(disk: Disk, tmp_path: Path) -> None:
    expected = BLOCKS * BLOCK_BYTES
    found = [shutil.disk_usage(path)[:3] for path in (disk.folder, disk.folder / "a.db")]
    assert found == [(expected, expected // 2, expected // 2)] * 2
    assert shutil.disk_usage(tmp_path.parent).total != expected


def test_a_file_that_is_open_at_the_end_is_an_error(tmp_path: Path) -> None:
    disk = Disk(tmp_path, Random(1))
    with pytest.raises(StillOpenError, match=r"still open.*test\.db"), attached(disk):
        connection = opened(disk)
    connection.close()


def test_a_clean_end_loses_nothing(disk: Disk) -> None:
    with closing(opened(disk, "OFF")) as connection:
        add(connection, range(50))
    assert numbers(disk) == set(range(50))


def test_a_loss_of_power_keeps_what_was_committed_with_a_sync(disk: Disk) -> None:
    for turn in range(20):
        connection = opened(disk)
        add(connection, range(turn * 50, turn * 50 + 50))
        lose_power(disk, connection)
        assert numbers(disk) == set(range(turn * 50 + 50))


def test_a_loss_of_power_loses_what_was_committed_without_a_sync(disk: Disk) -> None:
    with closing(opened(disk)) as connection:
        add(connection, range(50))
    connection = opened(disk, "NORMAL")
    add(connection, range(50, 100))
    assert lose_power(disk, connection) > 0
    found = numbers(disk)
    assert found >= set(range(50))
    assert not found >= set(range(100))


def test_power_is_lost_in_the_middle_of_a_commit_and_of_a_checkpoint(disk: Disk) -> None:
    done: set[int] = set()
    for turn in range(120):
        connection = opened(disk)
        connection.execute("PRAGMA wal_autocheckpoint=4")
        disk.die_after(turn)
        with suppress(sqlite3.OperationalError):
            for number in range(turn * 100, turn * 100 + 30):
                add(connection, range(number, number + 1))
                done.add(number)
        lose_power(disk, connection)
        assert numbers(disk) >= done
        done = numbers(disk)


def test_a_full_disk_takes_no_more_rows(disk: Disk) -> None:
    with closing(opened(disk)) as connection:
        disk.is_full = True
        with pytest.raises(sqlite3.OperationalError, match="full"):
            add(connection, range(1000))
        disk.is_full = False
        add(connection, range(1000, 1010))
    assert numbers(disk) >= set(range(1000, 1010))


def test_a_read_only_disk_takes_nothing(disk: Disk) -> None:
    with closing(opened(disk)) as connection:
        disk.is_read_only = True
        with pytest.raises(sqlite3.OperationalError, match="I/O"):
            add(connection, range(1))
        disk.is_read_only = False
    assert numbers(disk) == set()


def test_a_slow_disk_takes_its_time(disk: Disk) -> None:
    with closing(opened(disk)) as connection:
        disk.sync_s = 0.5
        waited_s = disk.waited_s
        add(connection, range(4))
        assert disk.waited_s - waited_s >= 2.0


def test_a_lock_of_somebody_else_is_waited_for_in_virtual_time(disk: Disk) -> None:
    with closing(opened(disk)) as connection, closing(opened(disk)) as other:
        other.execute("BEGIN IMMEDIATE")
        connection.execute("PRAGMA busy_timeout=3600000")
        with pytest.raises(sqlite3.OperationalError, match="locked"):
            add(connection, range(1))
        assert disk.waited_s > 3000.0


def test_files_of_other_folders_are_not_on_the_disk(disk: Disk, tmp_path: Path) -> None:
    disk.folder = tmp_path / "disk"
    disk.is_read_only = True
    with closing(sqlite3.connect(tmp_path / "other.db")) as connection:
        connection.execute("CREATE TABLE one (two)")


def test_files_beside_a_database_have_its_name(
    disk: Disk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    with closing(opened(disk)) as connection, closing(opened(disk)):
        add(connection, range(10))
        names = {path.name for path in tmp_path.iterdir()}
    assert names == {"elsewhere", "test.db", "test.db-shm", "test.db-wal"}
    assert not list(elsewhere.iterdir())
