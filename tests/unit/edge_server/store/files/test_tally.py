"""Counts that outlive whoever counts."""

import struct
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from edge_server.store.files.tally import Tally, read

NAMES = st.text("abcdefghijklmnopqrstuvwxyz_", min_size=1, max_size=30)


@given(counted=st.lists(st.tuples(NAMES, NAMES, st.integers(1, 1000)), max_size=60))
def test_what_is_counted_is_read(
    tmp_path_factory: object, counted: list[tuple[str, str, int]]
) -> None:
    path = tmp_path_factory.mktemp("tally") / "tally"  # type: ignore[attr-defined]  # pytest's
    tally = Tally(path)
    wanted: dict[str, dict[tuple[str, ...], float]] = {}
    for name, label, amount in counted:
        tally.add(name, label, amount=amount)
        values = wanted.setdefault(name, {})
        values[label,] = values.get((label,), 0.0) + amount
    assert read(path) == wanted
    tally.close()


def test_counts_go_on_where_a_killed_process_left_them(tmp_path: Path) -> None:
    path = tmp_path / "tally"
    for _ in range(3):  # Never closed, as by a kill
        Tally(path).add("delivered", "pose")
        Tally(path).add("delivered", "alarm", amount=2.0)
    assert read(path) == {"delivered": {("pose",): 3.0, ("alarm",): 6.0}}


def test_a_state_is_what_was_said_last(tmp_path: Path) -> None:
    tally = Tally(tmp_path / "tally")
    tally.put("uplink", value=2.0)
    tally.put("uplink", value=1.0)
    assert read(tmp_path / "tally") == {"uplink": {(): 1.0}}


def test_a_file_that_is_not_there_holds_nothing(tmp_path: Path) -> None:
    assert read(tmp_path / "tally") == {}


def test_more_figures_than_fit_are_left_out_and_spoil_nothing(tmp_path: Path) -> None:
    tally = Tally(tmp_path / "tally")
    for number in range(2000):
        tally.add("many", str(number))
    tally.add("many", "0")
    values = read(tmp_path / "tally")["many"]
    assert values["0",] == 2.0
    assert 100 < len(values) < 2000


def test_where_nothing_can_be_written_counting_goes_on(tmp_path: Path) -> None:
    tally = Tally(tmp_path / "missing" / "tally")
    tally.add("delivered", "pose")
    assert read(tmp_path / "missing" / "tally") == {}


def test_a_file_of_something_else_is_no_danger(tmp_path: Path) -> None:
    path = tmp_path / "tally"
    path.write_bytes(b"\xff" * 120 + struct.pack("=d", 1.0) + b"garbage")
    Tally(path).add("delivered", "pose")
    assert read(path)["delivered"] == {("pose",): 1.0}
