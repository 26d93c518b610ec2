import os
import stat
from pathlib import Path

import pytest

from uav_firmware.drivers.file_storage import FileStorage


def test_what_is_saved_is_loaded(tmp_path: Path) -> None:
    FileStorage(tmp_path / "new" / "folder").save("a.json", b"contents")
    assert FileStorage(tmp_path / "new" / "folder").load("a.json") == b"contents"


def test_nothing_stored_is_none(tmp_path: Path) -> None:
    assert FileStorage(tmp_path).load("a.json") is None


def test_saving_replaces_and_leaves_no_other_file(tmp_path: Path) -> None:
    storage = FileStorage(tmp_path)
    storage.save("a.json", b"former")
    storage.save("a.json", b"new")
    assert storage.load("a.json") == b"new"
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]


def test_a_refused_write_keeps_the_former_contents(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    storage = FileStorage(tmp_path)
    storage.save("a.json", b"former")

    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        storage.save("a.json", b"new")
    assert storage.load("a.json") == b"former"
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]


@pytest.mark.parametrize("name", ["", "../a", "a/b", ".hidden", "a\0b", "x" * 200])
def test_only_plain_names_are_taken(tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match="plain file name"):
        FileStorage(tmp_path).save(name, b"")


def test_what_is_removed_is_gone_and_removing_it_again_is_no_fault(tmp_path: Path) -> None:
    storage = FileStorage(tmp_path)
    storage.save("a.json", b"contents")
    storage.remove("a.json")
    storage.remove("a.json")
    assert storage.load("a.json") is None
    assert list(tmp_path.iterdir()) == []


def test_file_and_folder_reach_the_medium(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[bool] = []  # Whether it was a folder, and the file had its name by then

    def note(descriptor: int) -> None:
        is_folder = stat.S_ISDIR(os.fstat(descriptor).st_mode)
        assert (tmp_path / "a.json").exists() == is_folder
        synced.append(is_folder)

    monkeypatch.setattr("os.fsync", note)
    FileStorage(tmp_path).save("a.json", b"contents")
    assert synced == [False, True]


def test_what_a_killed_process_left_half_written_is_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    storage = FileStorage(tmp_path)
    storage.save("a.json", b"former")

    def killed(_descriptor: int) -> None:
        raise KeyboardInterrupt  # as little cleaning up as a kill

    monkeypatch.setattr("os.fsync", killed)
    with pytest.raises(KeyboardInterrupt):
        storage.save("a.json", b"new")
    monkeypatch.undo()
    assert len(list(tmp_path.iterdir())) == 2
    assert FileStorage(tmp_path).load("a.json") == b"former"
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
