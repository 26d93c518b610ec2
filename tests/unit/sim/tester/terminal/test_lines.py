"""Lines from whatever stands at the other end."""

import os
import threading
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.tester.terminal.lines import Lines, WakeableQueue, wait


def read_all(chunks: list[bytes]) -> list[str]:
    """What a reader makes of a pipe that is written in chunks and then closed."""
    read_end, write_end = os.pipe()
    lines, found = Lines(read_end), []
    try:
        for chunk in chunks:
            os.write(write_end, chunk)
            lines.read()
        os.close(write_end)
        while lines.is_open:
            lines.read()
        while lines.has_line:
            found.append(lines.pop())
    finally:
        os.close(read_end)
    assert lines.is_over
    return found


@given(st.lists(st.binary(min_size=1, max_size=20), max_size=10))
def test_lines_do_not_depend_on_how_they_arrive(chunks: list[bytes]) -> None:
    whole = b"".join(chunks)
    expected = whole.split(b"\n")
    if not expected[-1]:
        expected.pop()
    assert read_all(chunks) == [line.decode("utf-8", "replace") for line in expected]


def test_a_last_line_without_an_end_counts() -> None:
    assert read_all([b"1\n2"]) == ["1", "2"]


def test_a_line_without_end_does_not_fill_the_memory() -> None:
    lines = read_all([b"a" * 4096] * 40)
    assert len(lines) > 1
    assert "".join(lines) == "a" * 4096 * 40


def test_without_an_input_all_is_over() -> None:
    assert Lines(None).is_over
    with pytest.raises(ValueError, match="end"):
        Lines(None).fileno()


def test_another_thread_ends_a_wait() -> None:
    woken: WakeableQueue[int] = WakeableQueue()
    thread = threading.Timer(0.05, woken.put, (7,))
    thread.start()
    wait(Lines(None), woken, 60.0)
    assert woken.take() == [7]
    assert woken.take() == []
    thread.join()
    woken.close()
    woken.put(8)  # Too late, and no fault


def test_many_that_come_at_once_are_all_taken() -> None:
    woken: WakeableQueue[int] = WakeableQueue()
    for number in range(100_000):
        woken.put(number)
    assert woken.take() == list(range(100_000))
    woken.put(1)
    wait(Lines(None), woken, 60.0)
    assert woken.take() == [1]
    woken.close()


def test_a_file_is_read_like_a_terminal(tmp_path: Path) -> None:
    path = tmp_path / "lines"
    path.write_text("1\n2\n")
    woken: WakeableQueue[int] = WakeableQueue()
    descriptor = os.open(path, os.O_RDONLY)
    lines = Lines(descriptor)
    while lines.is_open:
        wait(lines, woken, 60.0)
    assert [lines.pop(), lines.pop()] == ["1", "2"]
    os.close(descriptor)
    woken.close()
