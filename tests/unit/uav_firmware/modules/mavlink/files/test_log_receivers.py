"""Downloads by foreign clients with a bounded receive buffer, in simulated time.

The buffer holds as many datagrams as Linux keeps for a program; the program takes them at a rate.
"""

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import pytest

from tests.unit.uav_firmware.modules.mavlink.files.test_log_server import (
    ALICE,
    ALL,
    SYSTEM,
    TICK_US,
    Reader,
    noise,
)
from uav_firmware.modules.mavlink.wire.dialect import mavlink

pytestmark = pytest.mark.usefixtures("no_open_files")

BUFFER: Final = 277
MAVPROXY_PER_S: Final = 930
MAVPROXY_SILENCE_US: Final = 700_000
MAVPROXY_RANGES: Final = 20
QGC_PIECES: Final = 512
QGC_SILENCE_US: Final = 500_000
PIECES: Final = 9_000
LOG: Final = noise(PIECES * 90 - 50)


class Receiver:
    """A client behind its buffer; `ask` gives the ranges (offset, bytes) that it requests."""

    def __init__(self, folder: Path, per_s: float, buffer: int = BUFFER) -> None:
        self.reader = Reader(folder)
        self.reader.log("2026-03-01", "09_00_00", LOG)
        self.reader.listed()
        self.began_us = self.heard_us = self.reader.now_us
        self.buffer: deque[Any] = deque()
        self.room, self.per_s = buffer, per_s
        self.budget = 0.0
        self.pieces: dict[int, bytes] = {}
        self.dropped = 0

    @property
    def silence_us(self) -> int:
        return self.reader.now_us - self.heard_us

    def gaps(self, first: int, end: int) -> list[tuple[int, int]]:
        """Missing runs of pieces (first, count)."""
        runs: list[tuple[int, int]] = []
        for number in range(first, end):
            if number in self.pieces:
                continue
            if runs and sum(runs[-1]) == number:
                runs[-1] = (runs[-1][0], runs[-1][1] + 1)
            else:
                runs.append((number, 1))
        return runs

    def request(self, first: int, size: int) -> None:
        message = mavlink.MAVLink_log_request_data_message(SYSTEM, 1, 0, first * 90, size)
        self.take(self.reader.server.handle(message, ALICE, self.reader.now_us))

    def take(self, outgoing: list[Any]) -> None:
        for one in outgoing:
            if len(self.buffer) < self.room:
                self.buffer.append(one.message)
            else:
                self.dropped += 1

    def step(self) -> None:
        self.take(self.reader.run(TICK_US * 1e-6))
        self.budget = min(self.budget + self.per_s * TICK_US * 1e-6, self.per_s * 0.1)
        while self.buffer and self.budget >= 1.0:
            self.budget -= 1.0
            message = self.buffer.popleft()
            self.pieces[message.ofs // 90] = bytes(message.data[: message.count])
            self.heard_us = self.reader.now_us

    def duration_s(self, go_on: Callable[[], None]) -> float:
        """Receive the whole log; gives the time that it took, at most ten minutes."""
        while len(self.pieces) < PIECES and self.reader.now_us - self.began_us < 600_000_000:
            self.step()
            go_on()
        assert b"".join(self.pieces[number] for number in sorted(self.pieces)) == LOG
        took_s = (self.reader.now_us - self.began_us) * 1e-6
        self.reader.send(mavlink.MAVLink_log_request_end_message(SYSTEM, 1))
        return took_s


def mavproxy(receiver: Receiver) -> float:
    """Ask for all, and after each silence for the first gaps (mavproxy_log.py of 1.8.75)."""

    def go_on() -> None:
        if receiver.silence_us < MAVPROXY_SILENCE_US or not receiver.pieces:
            return
        receiver.heard_us = receiver.reader.now_us
        highest = max(receiver.pieces)
        gaps = receiver.gaps(0, highest)
        for first, count in gaps[:MAVPROXY_RANGES]:
            receiver.request(first, count * 90)
        if not gaps:
            receiver.request(highest + 1, ALL)

    receiver.request(0, ALL)
    return receiver.duration_s(go_on)


def qgroundcontrol(receiver: Receiver) -> float:
    """Ask for 512 pieces, and after each silence for the first gap among them."""
    chunk = [0]

    def go_on() -> None:
        end = min(chunk[0] + QGC_PIECES, PIECES)
        gaps = receiver.gaps(chunk[0], end)
        if not gaps and end < PIECES:
            chunk[0] = end
            receiver.request(end, QGC_PIECES * 90)
        elif gaps and receiver.silence_us >= QGC_SILENCE_US:
            receiver.heard_us = receiver.reader.now_us
            receiver.request(gaps[0][0], gaps[0][1] * 90)

    receiver.request(0, QGC_PIECES * 90)
    return receiver.duration_s(go_on)


def test_mavproxy_loses_nothing_at_its_usual_speed(tmp_path: Path) -> None:
    receiver = Receiver(tmp_path, MAVPROXY_PER_S)
    assert mavproxy(receiver) == pytest.approx(PIECES / 500, rel=0.05)
    assert receiver.dropped == 0


@pytest.mark.parametrize("per_s", [450, 250])
def test_mavproxy_that_is_slow_gets_the_whole_log(tmp_path: Path, per_s: int) -> None:
    receiver = Receiver(tmp_path, per_s)
    assert mavproxy(receiver) < 120.0
    assert receiver.dropped < PIECES / 2


@pytest.mark.parametrize(("per_s", "most_s"), [(5_000, 8.0), (930, 16.0), (250, 80.0)])
def test_a_client_that_asks_in_chunks_finds_its_pace(
    tmp_path: Path, per_s: int, most_s: float
) -> None:
    receiver = Receiver(tmp_path, per_s)
    assert qgroundcontrol(receiver) < most_s
    assert receiver.dropped < PIECES / 50


def test_a_link_of_1_mbit_with_a_short_queue_carries_a_log(tmp_path: Path) -> None:
    """Some 900 pieces a second, less telemetry, through a modem that queues 64 datagrams."""
    receiver = Receiver(tmp_path, 650, buffer=64)
    assert mavproxy(receiver) == pytest.approx(PIECES / 500, rel=0.05)
    assert receiver.dropped == 0
