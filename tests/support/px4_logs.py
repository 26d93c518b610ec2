"""PX4's log server and its card, as the two versions of `mavlink_log_handler.cpp` make it behave.

Logs are listed with the time of their last change, in the order of the directory, which need not be
that of the flights. After a request for a few logs, `last_log_num` is the last one of them.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Final

from tests.support.vehicle_wire import Message, mavlink

PACKET_BYTES: Final = 90
ALL: Final = 0xFFFF


@dataclass(frozen=True)
class StoredLog:
    """A log on the card."""

    changed_s: int
    contents: bytes


class Px4Logs(ABC):
    """The log server of one link; subclasses are the two versions."""

    def __init__(self) -> None:
        self.card: list[StoredLog] = []
        self._listed: list[StoredLog] = []
        self._answers: Iterator[Message] = iter(())

    def receive(self, message: Message) -> None:
        """Handle a request; it ends what is being sent."""
        match message.get_type():
            case "LOG_REQUEST_LIST":
                self._answers = self._list(message.start, message.end)
            case "LOG_REQUEST_DATA":
                self._answers = self._data(message.id, message.ofs, message.count)
            case "LOG_REQUEST_END":
                self._answers = iter(())
                self._end()

    def send(self, most: int) -> list[Message]:
        """Send the next messages."""
        return list(islice(self._answers, most))

    @abstractmethod
    def _list(self, first: int, last: int) -> Iterator[Message]: ...

    @abstractmethod
    def _data(self, number: int, offset: int, count: int) -> Iterator[Message]: ...

    @abstractmethod
    def _end(self) -> None: ...

    def _entry(self, number: int, last: int) -> Message:
        log, count = self._listed[number], len(self._listed)
        return mavlink.MAVLink_log_entry_message(
            number, count, last, log.changed_s, len(log.contents)
        )


class Px4Logs114(Px4Logs):
    """1.14 and 1.15."""

    def __init__(self) -> None:
        super().__init__()
        self._is_active = False

    def _list(self, first: int, last: int) -> Iterator[Message]:
        if first == 0 or not self._is_active:
            self._listed = list(self.card)
        self._is_active = True
        if not self._listed:
            return iter([mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0)])
        greatest = len(self._listed) - 1
        first, last = min(first, greatest), min(last, greatest)
        return (self._entry(number, last) for number in range(first, last + 1))

    def _data(self, number: int, offset: int, count: int) -> Iterator[Message]:
        if not self._is_active or number >= len(self._listed):
            return
        contents = self._listed[number].contents
        end = min(offset + count, len(contents))
        if offset >= end:
            yield _packet(number, offset, b"")
        for at in range(offset, end, PACKET_BYTES):
            yield _packet(number, at, contents[at : min(at + PACKET_BYTES, end)])

    def _end(self) -> None:
        self._is_active = False


class Px4Logs116(Px4Logs):
    """1.16: an empty card is not answered, a log stays open until its end or another one."""

    def __init__(self) -> None:
        super().__init__()
        self._open: tuple[int, bytes] | None = None

    def _list(self, first: int, last: int) -> Iterator[Message]:
        self._listed = list(self.card)
        stated = len(self._listed) if last == ALL else last
        return (self._entry(number, stated) for number in range(first, len(self._listed)))

    def _data(self, number: int, offset: int, count: int) -> Iterator[Message]:
        if number >= len(self._listed):
            return iter(())
        if self._open is None or self._open[0] != number:
            self._open = number, self._listed[number].contents
        return self._packets(number, self._open[1], offset, count)

    def _packets(self, number: int, contents: bytes, offset: int, count: int) -> Iterator[Message]:
        for at in range(offset, min(offset + count, len(contents)), PACKET_BYTES):
            if at + PACKET_BYTES >= len(contents):
                self._open = None
            yield _packet(number, at, contents[at : at + PACKET_BYTES])

    def _end(self) -> None:
        pass


def _packet(number: int, offset: int, data: bytes) -> Message:
    return mavlink.MAVLink_log_data_message(
        number, offset, len(data), list(data.ljust(PACKET_BYTES, b"\0"))
    )
