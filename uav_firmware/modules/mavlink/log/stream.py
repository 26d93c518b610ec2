"""LOGGING_START: the flight log as a stream to one peer while it is made.

    idle      --LOGGING_START--------------------> defining   ask the logger
    defining  --acknowledgement------------------> defining   the next packet
    defining  --all definitions acknowledged-----> streaming
    defining  --0.3 s without acknowledgement----> defining   the same packet again
    defining  --10 s without acknowledgement-----> idle       STATUSTEXT
    defining, streaming --LOGGING_STOP-----------> idle
    defining, streaming --START by the same------> defining   a new stream
    defining, streaming --START by another-------> unchanged  TEMPORARILY_REJECTED

The definitions go by LOGGING_DATA_ACKED, one at a time; without them the rest cannot be read.
Data goes by LOGGING_DATA. What does not fit while definitions are under way is dropped, and a
ULog message tells for how long.
"""

from collections import deque
from typing import Final, NamedTuple

from uav_firmware.bus import Queue, Topic
from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.commands.commands import Command
from uav_firmware.modules.mavlink.log.stream_packets import (
    DATA_MAX,
    StreamPacket,
    cut,
    dropout,
)
from uav_firmware.modules.mavlink.telemetry.requests import Answer
from uav_firmware.modules.mavlink.telemetry.status_text import StatusTexts
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender, is_for_us
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.msg.log import LogStreamChunk, LogStreamRequest

REPEAT_US: Final = 300_000
GIVE_UP_US: Final = 10_000_000
PACKETS_PER_TICK: Final = 24
MAX_WAITING: Final = 1000
"""Packets of data, a quarter of a megabyte."""
_ULOG: Final = 0.0
_ACCEPTED: Final[int] = mavlink.MAV_RESULT_ACCEPTED
_DENIED: Final[int] = mavlink.MAV_RESULT_DENIED
_BUSY: Final[int] = mavlink.MAV_RESULT_TEMPORARILY_REJECTED


class _Unacknowledged(NamedTuple):
    """A definition that is under way."""

    message: Message
    first_us: int
    sent_us: int


class LogStream:
    """Streams the log to the one who has asked for it."""

    def __init__(
        self,
        *,
        system_id: int,
        request: Topic[LogStreamRequest],
        chunks: Queue[LogStreamChunk],
        texts: StatusTexts,
    ) -> None:
        """Take the topic on which the log is asked for, and the queue on which it comes."""
        self._system_id = system_id
        self._request = request
        self._chunks = chunks
        self._texts = texts
        self._owner: Sender | None = None
        self._number = 0
        self._sequence = 0
        self._definitions: deque[StreamPacket] = deque()
        self._data: deque[StreamPacket] = deque()
        self._under_way: _Unacknowledged | None = None
        self._missing_since_us: int | None = None

    def answer(self, command: Command, sender: Sender, _now_us: int) -> Answer | None:
        """Answer LOGGING_START and LOGGING_STOP; None when the command is neither."""
        if command.number == mavlink.MAV_CMD_LOGGING_STOP:
            if self._owner is not None and self._owner.identity == sender.identity:
                self._stop()
            return Answer(_ACCEPTED)
        if command.number != mavlink.MAV_CMD_LOGGING_START:
            return None
        if command.parameter(1) != _ULOG:
            return Answer(_DENIED)
        if self._owner is not None and self._owner.identity != sender.identity:
            return Answer(_BUSY)
        self._stop()
        self._owner = sender
        self._number += 1
        self._sequence = 0
        self._request.publish(LogStreamRequest(self._number))
        return Answer(_ACCEPTED)

    def acknowledged(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Take LOGGING_ACK: the next definition goes at once."""
        waiting, owner = self._under_way, self._owner
        if waiting is None or owner is None or not is_for_us(message, self._system_id):
            return []
        if sender.identity != owner.identity or message.sequence != waiting.message.sequence:
            return []
        self._under_way = None
        return self._define(owner, now_us)

    def tick(self, now_us: int) -> list[Outgoing]:
        """Send what is due."""
        chunks, owner = self._chunks.drain(), self._owner
        if owner is None:
            return []
        for chunk in chunks:
            self._take(chunk)
        if self._under_way is not None:
            return self._repeat(self._under_way, owner, now_us)
        if self._definitions:
            return self._define(owner, now_us)
        count = min(len(self._data), PACKETS_PER_TICK)
        return [self._send(owner, self._data.popleft()) for _ in range(count)]

    def forget(self, address: Address) -> None:
        """Stop the stream to a peer that is gone."""
        if self._owner is not None and self._owner.address == address:
            self._stop()

    def _stop(self) -> None:
        self._owner = None
        self._definitions.clear()
        self._data.clear()
        self._under_way = None
        self._missing_since_us = None
        self._request.publish(LogStreamRequest(0))

    def _take(self, chunk: LogStreamChunk) -> None:
        """Cut a chunk of this stream into packets, as long as there is room for them."""
        if chunk.number != self._number:
            return
        if chunk.is_definition:
            self._definitions.extend(cut(chunk.data))
            return
        if len(self._data) + len(chunk.data) // DATA_MAX >= MAX_WAITING:
            if self._missing_since_us is None:
                self._missing_since_us = chunk.time_us
            return
        data = chunk.data
        if self._missing_since_us is not None:
            data = dropout(chunk.time_us - self._missing_since_us) + data
            self._missing_since_us = None
        self._data.extend(cut(data))

    def _define(self, owner: Sender, now_us: int) -> list[Outgoing]:
        """Send the next definition."""
        if not self._definitions:
            return []
        packet = self._definitions.popleft()
        message = mavlink.MAVLink_logging_data_acked_message(*self._contents(owner, packet))
        self._under_way = _Unacknowledged(message, now_us, now_us)
        return [Outgoing(message, owner.address)]

    def _repeat(self, waiting: _Unacknowledged, owner: Sender, now_us: int) -> list[Outgoing]:
        """Send a definition again, or give up."""
        if now_us - waiting.first_us >= GIVE_UP_US:
            self._stop()
            text = "Log stream stopped: not acknowledged"
            return self._texts.say(mavlink.MAV_SEVERITY_WARNING, text)
        if now_us - waiting.sent_us < REPEAT_US:
            return []
        self._under_way = waiting._replace(sent_us=now_us)
        return [Outgoing(waiting.message, owner.address)]

    def _send(self, owner: Sender, packet: StreamPacket) -> Outgoing:
        message = mavlink.MAVLink_logging_data_message(*self._contents(owner, packet))
        return Outgoing(message, owner.address)

    def _contents(self, owner: Sender, packet: StreamPacket) -> tuple[object, ...]:
        """The fields that both messages have, with the next number."""
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
