"""The pipe that wakes the relay."""

import os
from pathlib import Path

import pytest

from edge_server.outbox import wakeup
from tests.support.descriptors import many_open_files


def readable(descriptor: int) -> bool:
    return descriptor in wakeup.wait([descriptor], 0.0).readable


def test_a_wake_is_seen_and_then_gone(tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    reader = wakeup.open_for_reading(path)
    assert not readable(reader)
    wakeup.wake(path)
    wakeup.wake(path, changed=True)
    assert readable(reader)
    assert wakeup.CHANGED in wakeup.drain(reader)
    assert not readable(reader)
    os.close(reader)


def test_a_pipe_of_a_process_with_many_open_files_wakes() -> None:
    with many_open_files():
        reader, writer = wakeup.open_pair()
        assert reader > 1023
        assert not wakeup.wait([reader], 0.0, writers=[writer]).readable
        wakeup.write(writer, changed=False)
        ready = wakeup.wait([reader], 0.0, writers=[writer])
        assert reader in ready.readable
        assert writer in ready.writable
        wakeup.close(writer)
        assert wakeup.wait([reader], 0.0).readable == {reader}
        wakeup.close(reader)


def test_waking_nobody_is_harmless(tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    wakeup.wake(path)
    os.close(wakeup.open_for_reading(path))
    wakeup.wake(path)


@pytest.mark.thorough
def test_a_full_pipe_does_not_hold_up_the_server(tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    reader = wakeup.open_for_reading(path)
    for _ in range(100_000):
        wakeup.wake(path)
    assert readable(reader)
    os.close(reader)


def test_a_file_in_the_pipes_place_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    path.write_text("not a pipe", encoding="ascii")
    reader = wakeup.open_for_reading(path)
    wakeup.wake(path)
    assert readable(reader)
    os.close(reader)
