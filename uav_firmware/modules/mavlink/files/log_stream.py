"""Server of LOGGING_START: streams the flight log to one peer while it is recorded.

    idle      --LOGGING_START--------------------> defining   request the log
    defining  --acknowledgement------------------> defining   the next packet
    defining  --all definitions acknowledged-----> streaming
    defining  --0.3 s without acknowledgement----> defining   the same packet again
    defining  --10 s without acknowledgement-----> idle       STATUSTEXT
    defining, streaming --LOGGING_STOP-----------> idle
    defining, streaming --START by the same------> defining   a new stream
    defining, streaming --START by another-------> unchanged  TEMPORARILY_REJECTED

LOGGING_DATA_ACKED carries the definitions, one at a time, because the log is unreadable without
them. LOGGING_DATA carries data. Data that does not fit in the queue while definitions are sent is
dropped, and a ULog dropout message states for how long.
"""

import struct
from collections import deque
from collections.abc import Iterator
from typing import Final, NamedTuple

from uav_firmware.bus import Queue, Topic
from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.commands.commands import (
    Answer,
    Command,
    denied,
    temporarily_rejected,
)
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender, is_for_us
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.msg.log import LogStreamChunk, LogStreamRequest

DATA_MAX: Final = 249
NO_MESSAGE: Final = 255
_MAGIC: Final = b"\x55\x4c\x6f\x67"
_FILE_HEADER_BYTES: Final = 16
_MESSAGE_HEADER_BYTES: Final = 3
_SIZE: Final = struct.Struct("<H")
_DROPOUT: Final = struct.Struct("<HcH")
RETRY_US: Final = 300_000
ACK_TIMEOUT_US: Final = 10_000_000
PACKETS_PER_TICK: Final = 24
QUEUE_MAX: Final = 1000
"""Packets of data, a quarter of a megabyte."""
_ULOG: Final = 0.0
_ACCEPTED: Final[int] = mavlink.MAV_RESULT_ACCEPTED


class StreamPacket(NamedTuple):
    """Contents of one LOGGING_DATA."""

    data: bytes
    first_message: int  # [bytes] Offset of the first message; 255 if none begins here


def split(chunk: bytes) -> Iterator[StreamPacket]:
    """Split complete messages, with or without the file header, into packets."""
    beginnings = _beginnings(chunk)
    beginning = next(beginnings, None)
    for start in range(0, len(chunk), DATA_MAX):
        while beginning is not None and beginning < start:
            beginning = next(beginnings, None)
        data = chunk[start : start + DATA_MAX]
        if beginning is not None and beginning < start + len(data):
            yield StreamPacket(data, beginning - start)
        else:
            yield StreamPacket(data, NO_MESSAGE)


def dropout(duration_us: int) -> bytes:
    """Encode a ULog dropout message."""
    return _DROPOUT.pack(2, b"O", min(duration_us // 1000, 0xFFFF))


def _beginnings(chunk: bytes) -> Iterator[int]:
    """Offsets of messages; the file header counts as one."""
    position = 0
    if chunk.startswith(_MAGIC):
        yield 0
        position = _FILE_HEADER_BYTES
    while position + _MESSAGE_HEADER_BYTES <= len(chunk):
        yield position
        (size,) = _SIZE.unpack_from(chunk, position)
        position += _MESSAGE_HEADER_BYTES + size


class _Unacknowledged(NamedTuple):
    """A definition that is not acknowledged yet."""

    message: Message
    first_us: int
    sent_us: int


class LogStream:
    """Streams the log to one peer."""

    def __init__(
        self,
        *,
        system_id: int,
        request: Topic[LogStreamRequest],
        chunks: Queue[LogStreamChunk],
        texts: StatusTexts,
    ) -> None:
        """`request` starts and stops the stream of the logger, `chunks` carries it."""
        self._system_id = system_id
        self._request = request
        self._chunks = chunks
        self._texts = texts
        self._owner: Sender | None = None
        self._number = 0
        self._sequence = 0
        self._definitions: deque[StreamPacket] = deque()
        self._data: deque[StreamPacket] = deque()
        self._unacknowledged: _Unacknowledged | None = None
        self._dropping_since_us: int | None = None

    def answer(self, command: Command, sender: Sender, _now_us: int) -> Answer | None:
        """Answer LOGGING_START and LOGGING_STOP; None for any other command."""
        if command.number == mavlink.MAV_CMD_LOGGING_STOP:
            if self._owner is not None and self._owner.identity == sender.identity:
                self._stop()
            return Answer(_ACCEPTED)
        if command.number != mavlink.MAV_CMD_LOGGING_START:
            return None
        if command.parameter(1) != _ULOG:
            return denied(f"parameter 1 is {command.parameter(1):g}: only ULog (0) is streamed")
        if self._owner is not None and self._owner.identity != sender.identity:
            return temporarily_rejected("the log is being streamed to another system")
        self._stop()
        self._owner = sender
        self._number += 1
        self._sequence = 0
        self._request.publish(LogStreamRequest(self._number))
        return Answer(_ACCEPTED)

    def acknowledged(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Handle LOGGING_ACK and send the next definition."""
        waiting, owner = self._unacknowledged, self._owner
        if waiting is None or owner is None or not is_for_us(message, self._system_id):
            return []
        if sender.identity != owner.identity or message.sequence != waiting.message.sequence:
            return []
        self._unacknowledged = None
        return self._define(owner, now_us)

    def tick(self, now_us: int) -> list[Outgoing]:
        """Send the packets that are due."""
        chunks, owner = self._chunks.drain(), self._owner
        if owner is None:
            return []
        for chunk in chunks:
            self._accept_chunk(chunk)
        if self._unacknowledged is not None:
            return self._retry(self._unacknowledged, owner, now_us)
        if self._definitions:
            return self._define(owner, now_us)
        count = min(len(self._data), PACKETS_PER_TICK)
        return [self._send(owner, self._data.popleft()) for _ in range(count)]

    def drop_peer(self, address: Address) -> None:
        """Stop the stream to a peer whose channel is closed."""
        if self._owner is not None and self._owner.address == address:
            self._stop()

    def _stop(self) -> None:
        self._owner = None
        self._definitions.clear()
        self._data.clear()
        self._unacknowledged = None
        self._dropping_since_us = None
        self._request.publish(LogStreamRequest(0))

    def _accept_chunk(self, chunk: LogStreamChunk) -> None:
        """Queue a chunk of this stream as packets if there is room."""
        if chunk.number != self._number:
            return
        if chunk.is_definition:
            self._definitions.extend(split(chunk.data))
            return
        if len(self._data) + len(chunk.data) // DATA_MAX >= QUEUE_MAX:
            if self._dropping_since_us is None:
                self._dropping_since_us = chunk.time_us
            return
        data = chunk.data
        if self._dropping_since_us is not None:
            data = dropout(chunk.time_us - self._dropping_since_us) + data
            self._dropping_since_us = None
        self._data.extend(split(data))

    def _define(self, owner: Sender, now_us: int) -> list[Outgoing]:
        """Send the next definition."""
        if not self._definitions:
            return []
        packet = self._definitions.popleft()
        message = mavlink.MAVLink_logging_data_acked_message(*self._contents(owner, packet))
        self._unacknowledged = _Unacknowledged(message, now_us, now_us)
        return [Outgoing(message, owner.address)]

    def _retry(self, waiting: _Unacknowledged, owner: Sender, now_us: int) -> list[Outgoing]:
        """Send a definition again, or time out."""
        if now_us - waiting.first_us >= ACK_TIMEOUT_US:
            self._stop()
            text = "Log stream stopped: not acknowledged"
            return self._texts.encode(mavlink.MAV_SEVERITY_WARNING, text)
        if now_us - waiting.sent_us < RETRY_US:
            return []
        self._unacknowledged = waiting._replace(sent_us=now_us)
        return [Outgoing(waiting.message, owner.address)]

    def _send(self, owner: Sender, packet: StreamPacket) -> Outgoing:
        message = mavlink.MAVLink_logging_data_message(*self._contents(owner, packet))
        return Outgoing(message, owner.address)

    def _contents(self, owner: Sender, packet: StreamPacket) -> tuple[object, ...]:
        """Common fields of both messages, with the next sequence number."""
        sequence = self._sequence
        self._sequence = (sequence + 1) & 0xFFFF
        data = packet.data.ljust(DATA_MAX, b"\x00")
        return (
            owner.system,
            owner.component,
            sequence,
            len(packet.data),
            packet.first_message,
            data,
        )
