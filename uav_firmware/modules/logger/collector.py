"""Topics in, records out: looks at each topic as often as its stream says."""

import struct
from collections.abc import Callable
from typing import Any, Final

from uav_firmware.bus import Topic
from uav_firmware.modules.logger import ulog
from uav_firmware.modules.logger.logged_message import LoggedMessage
from uav_firmware.modules.logger.streams import STREAMS, LoggerTopics

_DATA: Final = ord("D")
_RECORD_HEAD: Final = 3  # bytes of size and type, which the size does not count
_UNFIT: Final = (struct.error, ValueError, OverflowError)
"""What the making of a record raises for a value that its field cannot hold."""


class Source:
    """A topic with its place in the log, and the count of its message that was written last."""

    __slots__ = ("count", "name", "record", "topic")

    def __init__(self, number: int, message: LoggedMessage, topic: Topic[Any]) -> None:
        self.name = message.name
        self.topic = topic
        self.count = 0
        self.record = recorder(number, message)


def recorder(number: int, message: LoggedMessage) -> Callable[[Any], bytes]:
    """Give the function that makes a data message of subscription `number`."""
    layout = ulog.record_layout(message.fields)
    pack, values, size = layout.pack, message.values, layout.size - _RECORD_HEAD
    return lambda value: pack(size, _DATA, number, *values(value))


class Collector:
    """Records since the last `take`."""

    def __init__(self, topics: LoggerTopics, steps_per_second: int) -> None:
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
        self.unfit: set[str] = set()  # names of messages whose values could not be written
        self.use_rates(high=False)

    def use_rates(self, *, high: bool) -> None:
        """Lay out one second: which sources are looked at in which step."""
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
        """Write what is due and new in this step."""
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
        """Give the records collected, what seldom changes among them; none is given twice."""
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
