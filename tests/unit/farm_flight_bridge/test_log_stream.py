"""Log lines to a pipe whose reader stalls, ends or comes back."""

import fcntl
import io
import logging
import os
from collections.abc import Iterator
from typing import TextIO

import pytest
from hypothesis import given
from hypothesis import strategies as st

from farm_flight_bridge import log_stream
from farm_flight_bridge.log_stream import UnblockedStreamHandler

PIPE_BYTES = 4096


class Pipe:
    """A pipe of one page, with a handler at its one end."""

    def __init__(self) -> None:
        self.read_end, write_end = os.pipe()
        fcntl.fcntl(write_end, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        os.set_blocking(self.read_end, False)
        self.stream: TextIO = os.fdopen(write_end, "w")
        self.handler = UnblockedStreamHandler(self.stream)
        self.handler.setFormatter(logging.Formatter("%(levelname)s %(message)s"))

    def log(self, text: str) -> None:
        self.handler.handle(logging.LogRecord("test", logging.INFO, "", 0, text, (), None))

    def read(self) -> str:
        try:
            return os.read(self.read_end, 2 * PIPE_BYTES).decode()
        except BlockingIOError:
            return ""

    def close(self) -> None:
        os.close(self.read_end)
        self.stream.close()


@pytest.fixture
def pipe(monkeypatch: pytest.MonkeyPatch) -> Iterator[Pipe]:
    monkeypatch.setattr(log_stream, "PATIENCE_S", 0.0)
    made = Pipe()
    yield made
    made.close()


def test_a_line_arrives_as_a_line(pipe: Pipe) -> None:
    pipe.log("ready")
    assert pipe.read() == "INFO ready\n"


def test_a_full_pipe_holds_nobody_and_the_loss_is_counted(pipe: Pipe) -> None:
    for number in range(1000):
        pipe.log(f"line {number}")
    lines = pipe.read().splitlines()
    pipe.log("read again")
    after = pipe.read().splitlines()
    assert lines[0] == "INFO line 0"
    arrived = [line for line in [*lines, *after] if line.startswith("INFO line")]
    lost = 1000 - len([line for line in arrived if line == f"INFO line {arrived.index(line)}"])
    assert lost > 0
    assert f"WARNING {lost} lines of the log are lost: its reader had stalled" in after
    assert after[-1] == "INFO read again"


@given(lengths=st.lists(st.integers(0, 3 * PIPE_BYTES), min_size=1, max_size=20))
def test_whatever_the_lengths_each_line_arrives_or_is_counted(lengths: list[int]) -> None:
    pipe = Pipe()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(log_stream, "PATIENCE_S", 0.0)
        text = ""
        for number, length in enumerate(lengths):
            pipe.log(f"{number}:" + "x" * length)
            if number % 3 == 2:
                text += pipe.read()
        text += pipe.read()
        pipe.log("end")
        text += pipe.read()
    pipe.close()
    whole = {f"INFO {number}:" + "x" * length for number, length in enumerate(lengths)}
    arrived = whole & set(text.splitlines())
    lost = sum(int(one.split()[1]) for one in text.splitlines() if one.startswith("WARNING"))
    assert len(arrived) + lost == len(lengths)
    assert text.endswith("INFO end\n")


def test_a_reader_that_has_ended_costs_no_line_of_the_program(
    pipe: Pipe, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging, "raiseExceptions", False)  # As in a program whose stderr is gone
    os.close(pipe.read_end)
    for _ in range(3):
        pipe.log("nobody reads this")
    pipe.read_end = os.open(os.devnull, os.O_RDONLY)


def test_a_stream_without_a_descriptor_is_written_to() -> None:
    stream = io.StringIO()
    handler = UnblockedStreamHandler(stream)
    handler.handle(logging.LogRecord("test", logging.INFO, "", 0, "ready", (), None))
    assert stream.getvalue() == "ready\n"
