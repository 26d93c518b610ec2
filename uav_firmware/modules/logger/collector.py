"""Encodes topics as ULog records, each at the rate of its stream."""

import struct
from collections.abc import Callable
from typing import Any, Final

from uav_firmware.bus import Topic
from uav_firmware.modules.logger import ulog
from uav_firmware.modules.logger.streams import STREAMS
from uav_firmware.modules.logger.ulog import LoggedMessage
from uav_firmware.topics import Topics

_DATA: Final = ord("D")
_RECORD_HEAD: Final = 3  # [bytes] Size and type, which the size field does not count
_UNFIT: Final = (struct.error, ValueError, OverflowError)
"""Raised by `struct` for a value that does not fit its field."""


class Source:
    """A topic, its encoder, and the count of the message written last."""

    __slots__ = ("count", "name", "record", "topic")

    def __init__(self, number: int, message: LoggedMessage, topic: Topic[Any]) -> None:
        self.name = message.name
        self.topic = topic
        self.count = 0
        self.record = recorder(number, message)


def recorder(number: int, message: LoggedMessage) -> Callable[[Any], bytes]:
    """Return the function that encodes a value as a data message of subscription `number`."""
    layout = ulog.record_layout(message.fields)
    pack, values, size = layout.pack, message.values, layout.size - _RECORD_HEAD
    return lambda value: pack(size, _DATA, number, *values(value))


class Collector:
    """Collects records between two calls of `take`."""

    def __init__(self, topics: Topics, steps_per_second: int) -> None:
        self._steps_per_second = steps_per_second
        self._sources = [
            Source(number, stream.message, stream.topic(topics))
            for number, stream in enumerate(STREAMS)
        ]
        self._repeated = [
            source for source, row in zip(self._sources, STREAMS, strict=True) if row.repeated
        ]
        self._buffer = bytearray()
        self._slots: tuple[tuple[Source, ...], ...] = ()
        self._slot = 0
        self.unfit: set[str] = set()  # Names of messages with a value that did not fit
        self.use_rates(high=False)

    def use_rates(self, *, high: bool) -> None:
        """Schedule one second: which sources are read in which step."""
        dividers = [
            max(1, self._steps_per_second // (row.high_rate_hz if high else row.rate_hz))
            for row in STREAMS
        ]
        self._slots = tuple(
            tuple(
                source
                for number, source in enumerate(self._sources)
                if slot % dividers[number] == number % dividers[number]
            )
            for slot in range(self._steps_per_second)
        )

    def collect(self) -> None:
        """Encode the topics that are due in this step and have changed."""
        slot = self._slot
        for source in self._slots[slot]:
            topic = source.topic
            if topic.count != source.count:
                source.count = topic.count
                try:
                    self._buffer += source.record(topic.value)
                except _UNFIT:
                    self.unfit.add(source.name)
        self._slot = slot + 1 if slot + 1 < self._steps_per_second else 0

    def take(self, now_us: int) -> bytes:
        """Return and clear the collected records, with the repeated topics added."""
        for source in self._repeated:
            self._repeat(source, now_us)
        chunk = ulog.synchronisation() + bytes(self._buffer)
        self._buffer.clear()
        return chunk

    def _repeat(self, source: Source, now_us: int) -> None:
        value = source.topic.value
        if value is None:
            return
        source.count = source.topic.count
        try:
            self._buffer += source.record(value._replace(time_us=now_us))
        except _UNFIT:
            self.unfit.add(source.name)
