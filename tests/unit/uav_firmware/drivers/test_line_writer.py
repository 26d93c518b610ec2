"""Lines to a stream that may be stuck."""

import io
import os
from threading import Event

import pytest

from uav_firmware.drivers.line_writer import LineWriter


class HeldStream(io.StringIO):
    """A stream that takes nothing until it may."""

    def __init__(self) -> None:
        super().__init__()
        self.may = Event()

    def write(self, text: str) -> int:
        assert self.may.wait(30.0)
        return super().write(text)


def test_lines_come_in_their_order() -> None:
    stream = io.StringIO()
    writer = LineWriter(stream)
    for number in range(50):
        writer.write(f"line {number}")
    writer.close()
    assert stream.getvalue().splitlines() == [f"line {number}" for number in range(50)]


def test_a_stream_that_nobody_reads_holds_up_nobody_and_what_is_lost_is_counted() -> None:
    stream = HeldStream()
    writer = LineWriter(stream, waiting_max=10)
    for number in range(100):
        writer.write(f"line {number}")
    stream.may.set()
    writer.close()
    lines = stream.getvalue().splitlines()
    assert lines == [f"line {number}" for number in range(len(lines))]
    assert 10 <= len(lines) <= 11  # The thread held one more


def test_the_next_line_that_can_be_written_says_how_many_were_lost() -> None:
    stream = HeldStream()
    writer = LineWriter(stream, waiting_max=2)
    for number in range(10):
        writer.write(f"line {number}")
    stream.may.set()
    while writer._lines.qsize():
        Event().wait(0.01)
    writer.write("again")
    writer.close()
    lines = stream.getvalue().splitlines()
    assert lines[-1] == "again"
    assert lines[-2].endswith("lines lost: not written in time, or refused")
    assert len(lines) - 2 + int(lines[-2].split()[0]) == 10


def test_a_reader_that_has_gone_ends_the_lines_and_nothing_else() -> None:
    reads, writes = os.pipe()
    os.close(reads)
    stream = os.fdopen(writes, "w", encoding="utf-8")
    writer = LineWriter(stream)
    writer.write("nobody")
    writer.close()
    writer.write("nobody")
    with pytest.raises(BrokenPipeError):
        stream.close()


def test_a_line_that_the_streams_encoding_refuses_costs_itself_and_is_counted() -> None:
    contents = io.BytesIO()
    stream = io.TextIOWrapper(contents, encoding="ascii")
    writer = LineWriter(stream)
    writer.write("first")
    writer.write("11 \N{DEGREE SIGN}C")
    while not contents.getvalue() or writer._lines.qsize() or not writer._lost:
        assert writer._writing_thread.is_alive()
        Event().wait(0.01)
    writer.write("last")
    writer.close()
    first, lost, last = contents.getvalue().decode().splitlines()
    assert (first, last) == ("first", "last")
    assert lost.startswith("1 lines lost")


class FullDisk(io.StringIO):
    """A stream that refuses until there is room."""

    has_room = False

    def write(self, text: str) -> int:
        if not self.has_room:
            raise OSError(28, "No space left on device")
        return super().write(text)


def test_lines_that_a_full_disk_refused_are_all_counted_when_there_is_room_again() -> None:
    stream = FullDisk()
    writer = LineWriter(stream)
    for number in range(1, 6):
        writer.write(f"line {number}")
        while writer._lost < number:
            Event().wait(0.001)
    stream.has_room = True
    writer.write("again")
    writer.close()
    assert stream.getvalue().splitlines() == [
        "5 lines lost: not written in time, or refused",
        "again",
    ]
