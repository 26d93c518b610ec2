"""A file of lines: what was added is there, whatever is torn off, damaged, full or in the way."""

import errno
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.edge.spool_file import MAX_LINE_BYTES, OBSOLETE_BYTES, LineFile

LENGTHS = st.lists(st.integers(1, 60), min_size=1, max_size=12)
GONE = b"gone\n"


def line(number: int, length: int = 1) -> bytes:
    return b"%d:%s\n" % (number, b"x" * length)


def number_of(found: bytes) -> int | None:
    """The number of a whole line of ours."""
    number, colon, rest = found.partition(b":")
    whole = bool(colon) and rest.endswith(b"x\n") and not rest.strip(b"x\n")
    return int(number) if whole and number.isdigit() else None


def opened(path: Path) -> LineFile:
    file = LineFile(path)
    file.read(number_of)
    return file


def filled(path: Path, lengths: Sequence[int]) -> list[int]:
    """A file with so many lines, numbered from 1; gives where each ends."""
    file = opened(path)
    for number, length in enumerate(lengths, start=1):
        file.add({number: line(number, length)})
    file.close()
    ends, end = [], 0
    for number, length in enumerate(lengths, start=1):
        end += len(line(number, length))
        ends.append(end)
    return ends


@given(LENGTHS, st.floats(0.0, 1.0))
def test_whatever_is_torn_off_costs_no_line_before_it(lengths: list[int], where: float) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "reports"
        ends = filled(path, lengths)
        cut = round(where * ends[-1])
        os.truncate(path, cut)
        file = opened(path)
        whole = {number for number, end in enumerate(ends, start=1) if end <= cut}
        assert file.numbers == whole
        file.add({99: line(99)})
        file.close()
        assert opened(path).numbers == whole | {99}


@given(LENGTHS, st.floats(0.0, 1.0, exclude_max=True), st.integers(1, 255))
def test_a_damaged_byte_costs_the_lines_that_it_is_in(
    lengths: list[int], where: float, change: int
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "reports"
        ends = filled(path, lengths)
        reports = bytearray(path.read_bytes())
        place = int(where * len(reports))
        reports[place] ^= change
        path.write_bytes(reports)
        hit = next(number for number, end in enumerate(ends, start=1) if place < end)
        struck = {hit, hit + 1} if place == ends[hit - 1] - 1 else {hit}
        assert opened(path).numbers >= {*range(1, len(lengths) + 1)} - struck


def test_nothing_is_on_the_disk_before_something_is_added(tmp_path: Path) -> None:
    file = opened(tmp_path / "reports")
    file.release({1, 2}, GONE)
    assert file.writes == 0
    assert list(tmp_path.iterdir()) == []


def test_what_is_let_go_of_is_said_and_the_last_one_empties_the_file(tmp_path: Path) -> None:
    path = tmp_path / "reports"
    filled(path, [1, 1])
    file = opened(path)
    file.release({1}, GONE)
    assert path.read_bytes() == line(1) + line(2) + GONE
    file.release({2, 77}, GONE)
    assert path.read_bytes() == b""
    file.add({3: line(3)})
    assert opened(path).numbers == {3}


def test_waste_is_left_behind_when_there_is_more_of_it_than_of_anything_else(
    tmp_path: Path,
) -> None:
    path = tmp_path / "reports"
    filled(path, [10, OBSOLETE_BYTES + 50, 10, 20])
    file = opened(path)
    file.release({2}, GONE)
    assert path.read_bytes() == line(1, 10) + line(3, 10) + line(4, 20)
    file.release({3}, GONE)
    file.add({5: line(5)})
    assert file.size_bytes == path.stat().st_size
    assert [p.name for p in tmp_path.iterdir()] == ["reports"]
    assert opened(path).numbers == {1, 3, 4, 5}  # Reading is no business of this file's


class FullDisk:
    """Takes so many bytes more."""

    def __init__(self, room: int) -> None:
        self.room = room

    def write(self, descriptor: int, reports: bytes) -> int:
        if not self.room:
            raise OSError(errno.ENOSPC, "No space left on device")
        taken = self._write(descriptor, reports[: self.room])
        self.room -= taken
        return taken

    _write = staticmethod(os.write)


@given(room=st.integers(0, 40))
def test_a_full_disk_takes_all_of_it_or_nothing(room: int) -> None:
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        path = Path(folder) / "reports"
        filled(path, [5])
        file = opened(path)
        patch.setattr(os, "write", FullDisk(room).write)
        with pytest.raises(OSError, match="No space left"):
            file.add({2: line(2, 20), 3: line(3, 20)})
        assert path.read_bytes() == line(1, 5)
        patch.undo()
        file.add({4: line(4)})
        assert opened(path).numbers == {1, 4}


def test_a_full_disk_leaves_the_old_file_when_it_cannot_be_written_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "reports"
    filled(path, [5, 5])
    file = opened(path)
    monkeypatch.setattr(os, "write", FullDisk(3).write)
    with pytest.raises(OSError, match="No space left"):
        file.compact()
    monkeypatch.undo()
    assert [p.name for p in tmp_path.iterdir()] == ["reports"]
    file.add({3: line(3)})
    assert opened(path).numbers == {1, 2, 3}


def test_a_power_cut_that_was_reported_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_descriptor: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    file = opened(tmp_path / "reports")
    monkeypatch.setattr(os, "fdatasync", broken)
    with pytest.raises(OSError, match="Input/output"):
        file.add({1: line(1)})
    assert 1 not in file
    assert opened(tmp_path / "reports").numbers == frozenset()


def test_a_copy_that_a_killed_broker_left_is_in_nobodys_way(tmp_path: Path) -> None:
    path = tmp_path / "reports"
    filled(path, [1])
    (tmp_path / "reports.new").write_bytes(line(9))
    opened(path).compact()
    assert opened(path).numbers == {1}


def test_a_file_that_somebody_removes_is_made_again_with_all_that_it_held(tmp_path: Path) -> None:
    path = tmp_path / "reports"
    filled(path, [1])
    file = opened(path)
    path.unlink()
    file.add({2: line(2)})
    assert opened(path).numbers == {1, 2}


def test_a_line_without_end_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "reports"
    path.write_bytes(line(1) + b"x" * (2 * MAX_LINE_BYTES + 5) + b"\n" + line(2))
    assert opened(path).numbers == {1, 2}


def test_holes_are_read_as_nothing(tmp_path: Path) -> None:
    path = tmp_path / "reports"
    path.write_bytes(line(1))
    os.truncate(path, 64 << 20)
    file = opened(path)
    file.add({2: line(2)})
    assert path.read_bytes() == line(1) + line(2)


@pytest.mark.parametrize("kind", ["folder", "pipe", "link"])
def test_what_is_no_file_is_refused_at_once(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "reports"
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OSError, match=r"reports|no file"):
        LineFile(path).read(number_of)


def test_nobody_else_may_read_it(tmp_path: Path) -> None:
    filled(tmp_path / "reports", [1])
    assert (tmp_path / "reports").stat().st_mode & 0o077 == 0
