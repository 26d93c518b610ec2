import io
import struct
from typing import Any, Final

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyulog import ULog  # type: ignore[import-untyped]  # pyulog has no types

from tests.unit.uav_firmware.modules.logger.harness import LoggerHarness, MemoryStore
from uav_firmware.modules.mavlink.commands.commands import Command
from uav_firmware.modules.mavlink.files.log_stream import (
    ACK_TIMEOUT_US,
    DATA_MAX,
    NO_MESSAGE,
    QUEUE_MAX,
    LogStream,
    split,
)
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import mavlink, pack
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.msg.log import LogStreamChunk

SYSTEM: Final = 7
START, STOP = 2510, 2511
ACCEPTED, BUSY, DENIED = 0, 1, 2
ALICE: Final = Sender(255, 190, ("192.0.2.2", 14550))
BOB: Final = Sender(254, 191, ("192.0.2.3", 14540))
TICK_US: Final = 20_000


class Listener:
    """A logger, the stream of its log, and the receiving peer."""

    def __init__(self) -> None:
        self.book = LoggerHarness(MemoryStore())
        topics = self.book.topics
        self.stream = LogStream(
            system_id=SYSTEM,
            request=topics.log_stream_request,
            chunks=topics.log_stream,
            texts=StatusTexts(),
        )
        self.received: list[Any] = []
        self.unreachable = False

    def request(self, number: int, sender: Sender = ALICE, *parameters: float) -> int:
        padded = (*parameters, *[0.0] * (7 - len(parameters)))
        command = Command(number, padded, 0)  # type: ignore[arg-type]  # seven
        answer = self.stream.answer(command, sender, self.book.time_us)
        assert answer is not None
        return answer.result

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 1e6 / TICK_US)):
            self.book.run(TICK_US / 1e6)
            self._hear(self.stream.tick(self.book.time_us))

    def data(self) -> bytes:
        return b"".join(bytes(m.data[: m.length]) for m in self.received)

    def _hear(self, outgoing: list[Outgoing]) -> None:
        for one in outgoing:
            pack(one.message)
            self.received.append(one.message)
            if one.message.get_type() == "LOGGING_DATA_ACKED" and not self.unreachable:
                ack = mavlink.MAVLink_logging_ack_message(SYSTEM, 1, one.message.sequence)
                self._hear(self.stream.acknowledged(ack, ALICE, self.book.time_us))


def test_the_stream_is_a_readable_log() -> None:
    listener = Listener()
    listener.run(1.0)
    assert listener.received == []
    assert listener.request(START) == ACCEPTED
    listener.run(5.0)
    log = ULog(io.BytesIO(listener.data()))
    attitude = log.get_dataset("vehicle_attitude").data["timestamp"]
    assert attitude[-1] - attitude[0] > 3_500_000
    assert log.dropouts == []
    assert [m.sequence for m in listener.received] == list(range(len(listener.received)))
    assert {(m.target_system, m.target_component) for m in listener.received} == {(255, 190)}
    assert listener.book.warnings() == []


def test_logging_stop_ends_the_stream() -> None:
    listener = Listener()
    listener.request(START)
    listener.run(2.0)
    assert listener.request(STOP) == ACCEPTED
    count = len(listener.received)
    listener.run(2.0)
    assert len(listener.received) == count


def test_a_second_start_begins_a_new_log() -> None:
    listener = Listener()
    listener.request(START)
    listener.run(2.0)
    listener.received.clear()
    assert listener.request(START) == ACCEPTED
    listener.run(2.0)
    assert listener.received[0].sequence == 0
    ULog(io.BytesIO(listener.data())).get_dataset("vehicle_attitude")


def test_a_second_listener_is_rejected() -> None:
    listener = Listener()
    listener.request(START)
    assert listener.request(START, BOB) == BUSY
    assert listener.request(STOP, BOB) == ACCEPTED
    listener.run(1.0)
    assert listener.received
    listener.request(STOP)
    assert listener.request(START, BOB) == ACCEPTED


def test_another_format_is_denied() -> None:
    assert Listener().request(START, ALICE, 1.0) == DENIED


def test_a_definition_is_repeated_until_it_is_acknowledged() -> None:
    listener = Listener()
    listener.unreachable = True
    listener.request(START)
    listener.run(3.0)
    assert {m.sequence for m in listener.received} == {0}
    assert 5 <= len(listener.received) <= 10
    listener.unreachable = False
    listener.run(3.0)
    assert len({m.sequence for m in listener.received}) > 50
    first = {m.sequence: bytes(m.data[: m.length]) for m in reversed(listener.received)}
    whole = b"".join(first[number] for number in sorted(first))
    assert ULog(io.BytesIO(whole)).dropouts == []


def test_a_stream_without_acknowledgements_times_out() -> None:
    listener = Listener()
    listener.unreachable = True
    listener.request(START)
    listener.run(ACK_TIMEOUT_US / 1e6 + 2.0)
    assert listener.received[-1].get_type() == "STATUSTEXT"
    count = len(listener.received)
    listener.run(2.0)
    assert len(listener.received) == count
    assert listener.request(START, BOB) == ACCEPTED


def test_a_closed_peer_gets_no_more_packets() -> None:
    listener = Listener()
    listener.request(START)
    listener.run(2.0)
    listener.stream.drop_peer(BOB.address)
    count = len(listener.received)
    listener.run(1.0)
    assert len(listener.received) > count
    listener.stream.drop_peer(ALICE.address)
    count = len(listener.received)
    listener.run(1.0)
    assert len(listener.received) == count


def test_dropped_data_is_marked_by_a_dropout() -> None:
    listener = Listener()
    listener.request(START)
    topics = listener.book.topics
    for i in range(4):
        big = struct.pack("<Hc", 60_000, b"D") + bytes(60_000)
        chunk = LogStreamChunk(1, 500_000 * i, is_definition=False, data=big * 2)
        topics.log_stream.publish(chunk)
    listener._hear(listener.stream.tick(0))
    assert len(listener.stream._data) <= QUEUE_MAX
    listener.stream._data.clear()
    topics.log_stream.publish(LogStreamChunk(1, 9_000_000, is_definition=False, data=b""))
    (reported,) = listener.stream.tick(0)
    size, kind, missing_ms = struct.unpack("<HcH", bytes(reported.message.data[:5]))
    assert (size, kind) == (2, b"O")
    assert missing_ms == pytest.approx(8_000, abs=500)


@given(st.lists(st.integers(0, 700), max_size=12), st.booleans())
def test_packets_have_the_offset_of_the_first_message(sizes: list[int], header: bool) -> None:
    chunk, beginnings = b"", []
    if header:
        beginnings.append(0)
        chunk += b"ULog" + bytes(12)
    for size in sizes:
        beginnings.append(len(chunk))
        chunk += struct.pack("<Hc", size, b"D") + bytes(size)
    packets = list(split(chunk))
    assert b"".join(packet.data for packet in packets) == chunk
    for i, packet in enumerate(packets):
        start, end = i * DATA_MAX, i * DATA_MAX + len(packet.data)
        within = [b - start for b in beginnings if start <= b < end]
        assert packet.first_message == (within[0] if within else NO_MESSAGE)
