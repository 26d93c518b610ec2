"""Orders through a file, in an operator's steps."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from sim.faults.console import FaultConsole


@pytest.fixture
def console(tmp_path: Path) -> Iterator[FaultConsole]:
    made = FaultConsole(tmp_path)
    yield made
    made.close()


def add(folder: Path, text: str) -> None:
    with (folder / "faults.txt").open("a", encoding="utf-8") as file:
        file.write(text)


def test_nothing_is_ordered_until_somebody_writes(console: FaultConsole) -> None:
    assert console.poll() == []


def test_each_line_is_handed_over_once(console: FaultConsole, tmp_path: Path) -> None:
    add(tmp_path, "gps_loss\nclear\n")
    assert console.poll() == ["gps_loss", "clear"]
    assert console.poll() == []


def test_half_a_line_waits_for_its_end(console: FaultConsole, tmp_path: Path) -> None:
    add(tmp_path, "gps_")
    assert console.poll() == []
    add(tmp_path, "loss\n")
    assert console.poll() == ["gps_loss"]


def test_a_file_written_anew_is_read_anew(console: FaultConsole, tmp_path: Path) -> None:
    add(tmp_path, "motor_loss motor=1\n")
    console.poll()
    (tmp_path / "faults.txt").write_text("clear\n", encoding="utf-8")
    assert console.poll() == ["clear"]


def test_remarks_blank_lines_and_bytes_that_are_no_text_do_no_harm(
    console: FaultConsole, tmp_path: Path
) -> None:
    with (tmp_path / "faults.txt").open("ab") as file:
        file.write(b"# remark\n\n  \n\xff\xfe\nclear\n")
    assert console.poll()[-1] == "clear"


def test_orders_of_a_former_flight_are_not_carried_out(tmp_path: Path) -> None:
    add(tmp_path, "motor_loss motor=1\n")
    console = FaultConsole(tmp_path)
    assert console.poll() == []
    console.close()
    console.close()
