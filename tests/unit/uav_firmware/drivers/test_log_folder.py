"""Names by time, room made by removing the oldest."""

from pathlib import Path

import pytest

from uav_firmware.drivers.log_folder import LogFolder

NOON_US = 1_772_366_400_000_000  # 2026-03-01 12:00:00 UTC
DAY_US = 86_400_000_000


def write(folder: LogFolder, time_utc_us: int, size: int = 10) -> Path:
    file = folder.create(time_utc_us)
    file.write(bytes(size))
    file.close()
    return file.path


def test_a_file_is_named_after_its_time(tmp_path: Path) -> None:
    path = write(LogFolder(tmp_path), NOON_US + 61_999_999)
    assert path == tmp_path / "2026-03-01" / "12_01_01.ulg"


def test_two_files_of_one_second_have_two_names(tmp_path: Path) -> None:
    folder = LogFolder(tmp_path)
    paths = [write(folder, NOON_US) for _ in range(12)]
    assert len(set(paths)) == 12
    assert folder.files() == paths


def test_a_folder_that_is_not_there_yet_holds_no_file(tmp_path: Path) -> None:
    assert LogFolder(tmp_path / "none").files() == []


def test_the_oldest_make_room_for_the_newest(tmp_path: Path) -> None:
    folder = LogFolder(tmp_path, files_max=3)
    paths = [write(folder, NOON_US + number * DAY_US) for number in range(5)]
    assert folder.files() == paths[2:]
    assert sorted(day.name for day in tmp_path.iterdir()) == [p.parent.name for p in paths[2:]]


def test_bytes_are_bounded_too(tmp_path: Path) -> None:
    folder = LogFolder(tmp_path, bytes_max=1000)
    paths = [write(folder, NOON_US + number * DAY_US, size=400) for number in range(5)]
    assert folder.files() == paths[2:]


def test_what_is_no_log_is_left_alone(tmp_path: Path) -> None:
    folder = LogFolder(tmp_path, files_max=1)
    first = write(folder, NOON_US)
    notes = [tmp_path / "notes.txt", first.parent / "photo.ulg.jpg", tmp_path / "2026-03-01.bak"]
    for note in notes:
        note.write_text("mine")
    write(folder, NOON_US + DAY_US)
    assert not first.exists()
    assert all(note.read_text() == "mine" for note in notes)


def test_each_write_is_in_the_file_at_once(tmp_path: Path) -> None:
    file = LogFolder(tmp_path).create(NOON_US)
    file.write(b"one")
    assert file.path.read_bytes() == b"one"
    file.write(b"two")
    file.sync()
    assert file.path.read_bytes() == b"onetwo"
    file.close()
    file.close()


def test_a_medium_that_refuses_says_so(tmp_path: Path) -> None:
    (tmp_path / "log").write_text("a file where the folder would be")
    with pytest.raises(OSError, match="log"):
        LogFolder(tmp_path / "log").create(NOON_US)


@pytest.mark.parametrize(("files_max", "bytes_max"), [(0, 1000), (5, 0)])
def test_no_room_at_all_is_refused(tmp_path: Path, files_max: int, bytes_max: int) -> None:
    with pytest.raises(ValueError, match="holds no log"):
        LogFolder(tmp_path, files_max=files_max, bytes_max=bytes_max)


def test_room_is_told_before_there_is_a_folder(tmp_path: Path) -> None:
    folder = tmp_path / "vehicle-1" / "log"
    assert LogFolder(folder).free_bytes() > 0
    assert not folder.exists()
