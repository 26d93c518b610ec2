"""The broker's database: one broker at a time, nothing lost in a kill, damage set aside."""

import errno
import logging
import os
import re
import shutil
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest

from mavlink_broker.database import (
    DATABASE_FILE,
    LOCK_FILE,
    Database,
    DatabaseBusyError,
    read_rows,
)
from tests.support.small_disk import NoSmallDiskError, fill_up, small_disk

ALL = "SELECT number, data FROM posts ORDER BY number"
ROWS = 200


def add(database: Database, number: int, data: bytes = b"x" * 1000) -> None:
    with database.change() as rows:
        rows.execute("INSERT INTO posts VALUES (?, 0, ?)", (number, data))


def numbers_in(folder: Path) -> list[int]:
    database = Database(folder)
    numbers = [number for number, _ in database.read(ALL)]
    database.close()
    return numbers


def filled(folder: Path) -> Path:
    """A closed database with rows; gives its file."""
    database = Database(folder)
    with database.change() as rows:
        posts = [(number, 0, b"x" * 1000) for number in range(ROWS)]
        rows.executemany("INSERT INTO posts VALUES (?, ?, ?)", posts)
    database.close()
    return folder / DATABASE_FILE


def test_two_brokers_cannot_use_one_folder(tmp_path: Path) -> None:
    first, second = Database(tmp_path), Database(tmp_path)
    first.open()
    with pytest.raises(DatabaseBusyError, match="another broker"):
        second.open()
    first.close()
    second.open()
    second.close()


def test_a_broker_is_the_same_after_a_restart_and_another_one_on_another_folder(
    tmp_path: Path,
) -> None:
    def identity(name: str) -> str:
        database = Database(tmp_path / name)
        database.open()
        database.close()
        return database.instance_id

    first = identity("first")
    assert re.fullmatch(r"[0-9A-HJKMNP-TV-Z]{26}", first)
    (tmp_path / "first" / DATABASE_FILE).write_bytes(b"damaged" * 1000)
    assert identity("first") == first
    assert identity("second") != first
    (tmp_path / "first" / LOCK_FILE).write_text(first[:9])
    renewed = identity("first")
    assert renewed != first
    assert identity("first") == renewed


def test_a_broker_whose_disk_stores_no_identity_is_known_by_its_key_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> int:
        raise OSError(errno.ENOSPC, "full")

    monkeypatch.setattr(os, "pwrite", refuse)
    database = Database(tmp_path)
    assert database.instance_id == ""
    database.open()
    database.close()
    assert database.instance_id == ""


def test_a_first_start_on_a_full_disk_names_the_disk_and_works_with_space(tmp_path: Path) -> None:
    try:
        with small_disk(tmp_path / "disk", 8) as folder:
            fill_up(folder / "others")
            database = Database(folder / "broker")
            for _ in range(2):  # The second finds the empty file of the first
                with pytest.raises(OSError, match=r"disk is full|No space left") as caught:
                    database.read(ALL)
                assert caught.value.errno == errno.ENOSPC
            (folder / "others").unlink()
            add(database, 1)
            database.close()
            assert numbers_in(folder / "broker") == [1]
    except NoSmallDiskError as error:
        pytest.skip(f"no file system can be mounted here: {error}")


def test_a_change_is_on_the_disk_and_the_lock_ends_when_the_broker_is_killed(
    tmp_path: Path,
) -> None:
    program = (
        "import os, sys; from pathlib import Path; from mavlink_broker.database import Database\n"
        "database = Database(Path(sys.argv[1]))\n"
        "with database.change() as rows: rows.execute(\"INSERT INTO posts VALUES (7, 0, 'x')\")\n"
        "with database.change() as rows:\n"
        "    rows.execute(\"INSERT INTO posts VALUES (8, 0, 'x')\"); os.kill(os.getpid(), 9)\n"
    )
    ended = subprocess.run([sys.executable, "-c", program, str(tmp_path)], check=False)
    assert ended.returncode == -9
    assert numbers_in(tmp_path) == [7]


def test_a_change_that_fails_changes_nothing(tmp_path: Path) -> None:
    database = Database(tmp_path)

    def fail() -> None:
        with database.change() as rows:
            rows.execute("INSERT INTO posts VALUES (1, 0, 'x')")
            rows.execute("INSERT INTO posts VALUES (2, 7, 'x')")

    with pytest.raises(OSError, match="CHECK constraint"):
        fail()
    add(database, 3)
    assert [number for number, _ in database.read(ALL)] == [3]
    database.close()


def _is_a_file(folder: Path) -> None:
    folder.write_text("not a folder")


def _has_a_folder_for_the_database(folder: Path) -> None:
    (folder / DATABASE_FILE).mkdir(parents=True)


def _has_a_link_for_the_database(folder: Path) -> None:
    folder.mkdir()
    (folder / DATABASE_FILE).symlink_to("/dev/zero")


def _has_a_pipe_for_the_database(folder: Path) -> None:
    folder.mkdir()
    os.mkfifo(folder / DATABASE_FILE)


def _has_a_link_for_a_lock(folder: Path) -> None:
    folder.mkdir()
    (folder / LOCK_FILE).symlink_to("/dev/null")


@pytest.mark.parametrize(
    "spoil",
    [
        _is_a_file,
        _has_a_folder_for_the_database,
        _has_a_link_for_the_database,
        _has_a_pipe_for_the_database,
        _has_a_link_for_a_lock,
    ],
)
def test_a_folder_that_cannot_be_used_is_an_error_until_it_can(
    spoil: Callable[[Path], None], tmp_path: Path
) -> None:
    folder = tmp_path / "broker"
    spoil(folder)
    database = Database(folder)
    with pytest.raises(OSError, match="broker"):
        database.open()
    if folder.is_dir():
        shutil.rmtree(folder)
    else:
        folder.unlink()
    add(database, 1)
    assert numbers_of(database) == [1]
    database.close()


def numbers_of(database: Database) -> list[int]:
    return [number for number, _ in database.read(ALL)]


def test_nobody_else_may_read_its_files(tmp_path: Path) -> None:
    database = Database(tmp_path)
    add(database, 1)
    modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()}
    database.close()
    assert len(modes) == 4
    assert set(modes.values()) == {0o600}


@pytest.mark.parametrize(
    "content", [b"not a database" * 100, b"SQLite format 3\0" + b"\xff" * 9000]
)
def test_a_file_that_is_no_database_is_set_aside_and_reported(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, content: bytes
) -> None:
    (tmp_path / DATABASE_FILE).write_bytes(content)
    with caplog.at_level(logging.ERROR):
        assert numbers_in(tmp_path) == []
    (logged,) = caplog.messages
    assert "is damaged" in logged
    assert "broker.db.bad" in logged
    assert (tmp_path / "broker.db.bad").read_bytes() == content


@pytest.mark.parametrize("statement", ["PRAGMA user_version = 2", "DROP TABLE records"])
def test_a_database_of_another_version_is_set_aside_and_its_rows_are_kept(
    tmp_path: Path, statement: str
) -> None:
    filled(tmp_path)
    database = Database(tmp_path)
    with database.change() as rows:
        rows.execute(statement)
    database.close()
    assert numbers_in(tmp_path) == list(range(ROWS))
    assert (tmp_path / "broker.db.bad").exists()


@pytest.mark.parametrize("seed", range(10))
def test_of_a_damaged_file_the_readable_rows_are_kept(tmp_path: Path, seed: int) -> None:
    path = filled(tmp_path)
    random, content = Random(seed), bytearray(path.read_bytes())
    place = random.randrange(4096, len(content) - 4096)
    content[place : place + 4096] = random.randbytes(4096)
    path.write_bytes(content)
    database = Database(tmp_path)
    kept = database.read(ALL)
    whole = [row for row in kept if row[1] == b"x" * 1000]
    assert len(whole) >= ROWS - 30
    add(database, 1_000_000)
    assert (1_000_000, b"x" * 1000) in database.read(ALL)
    database.close()


@pytest.mark.parametrize("cut", [0, 1, 100, 4096, 20_000, 300_001])
def test_a_truncated_file_is_no_reason_not_to_start(tmp_path: Path, cut: int) -> None:
    os.truncate(filled(tmp_path), cut)
    database = Database(tmp_path)
    add(database, 1_000_000)
    assert 1_000_000 in numbers_of(database)
    database.close()


def test_a_file_that_is_removed_is_written_again_with_all_rows(tmp_path: Path) -> None:
    database = Database(tmp_path)
    add(database, 1)
    (tmp_path / DATABASE_FILE).unlink()
    add(database, 2)
    database.close()
    assert numbers_in(tmp_path) == [1, 2]


def test_a_broker_killed_while_it_replaced_the_file_leaves_the_rows(tmp_path: Path) -> None:
    filled(tmp_path).rename(tmp_path / "broker.db.new")
    assert numbers_in(tmp_path) == list(range(ROWS))


def test_rows_are_read_beside_a_running_broker_and_after_it(tmp_path: Path) -> None:
    assert read_rows(tmp_path, ALL) == []
    database = Database(tmp_path)
    add(database, 1)
    assert [number for number, _ in read_rows(tmp_path, ALL)] == [1]
    database.close()
    assert [number for number, _ in read_rows(tmp_path, ALL)] == [1]
