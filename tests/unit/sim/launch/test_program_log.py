"""A program's log: appended to, bounded, and never in the program's way."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.launch.program_log import ProgramLog


def test_a_log_goes_on_where_the_last_run_ended(tmp_path: Path) -> None:
    path = tmp_path / "edge.log"
    for line in (b"first\n", b"second\n"):
        log = ProgramLog(path)
        assert log.append(line)
        log.close()
    assert path.read_bytes() == b"first\nsecond\n"


@given(lines=st.lists(st.binary(min_size=1, max_size=30), max_size=60))
def test_the_newest_lines_are_kept_in_bounded_room(
    tmp_path_factory: pytest.TempPathFactory, lines: list[bytes]
) -> None:
    folder = tmp_path_factory.mktemp("logs")
    log = ProgramLog(folder / "edge.log", bytes_max=50, kept=2)
    for line in lines:
        log.append(line)
    log.close()
    names = ("edge.log.2", "edge.log.1", "edge.log")
    assert {path.name for path in folder.iterdir()} <= set(names)
    assert all(path.stat().st_size <= 50 for path in folder.iterdir())
    found = b"".join(p.read_bytes() for name in names if (p := folder / name).exists())
    assert b"".join(lines).endswith(found)
    assert len(found) >= min(sum(map(len, lines)), 60)


def test_a_full_medium_costs_lines_and_is_used_again_when_there_is_room(tmp_path: Path) -> None:
    path = tmp_path / "edge.log"
    path.symlink_to("/dev/full")
    log = ProgramLog(path)
    assert not log.append(b"first\n")
    assert not log.append(b"second\n")
    assert log.lines_lost == 2
    path.unlink()
    assert log.append(b"third\n")
    log.close()
    assert path.read_bytes() == b"third\n"


def test_a_folder_that_is_gone_costs_lines(tmp_path: Path) -> None:
    assert not ProgramLog(tmp_path / "gone" / "edge.log").append(b"line\n")
