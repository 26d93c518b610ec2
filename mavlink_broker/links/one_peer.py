"""What a serial line and a connection of our own have in common: one byte stream, one peer."""

from abc import ABC, abstractmethod

from mavlink_broker.links.link import Arrival, Retry
from mavlink_broker.links.stream import Stream, StreamEndedError
from mavlink_broker.links.url import Address, LinkUrl


class OnePeerLink(ABC):
    """A stream that comes and goes; how it is opened is the subclass's."""

    def __init__(self, url: LinkUrl, number: int, retry: Retry) -> None:
        self.url = url
        self._address = Address(url.host, url.port, number)
        self._retry = retry
        self._stream: Stream | None = None
        self._dropped = 0

    @property
    def dropped(self) -> int:
        """Frames that were not taken in time."""
        return self._dropped + (self._stream.dropped if self._stream else 0)

    def readers(self) -> list[int]:
        """The open stream."""
        return [self._stream.descriptor] if self._stream else []

    def greeted(self) -> list[Address]:
        """Whoever is at the other end."""
        return [self._address] if self._stream else []

    def send(self, address: Address, frame: bytes) -> None:
        """Send a frame, now or when there is room."""
        del address
        if self._stream is None:
            return
        try:
            self._stream.send(frame)
        except StreamEndedError:
            return  # The next step reads the same, and closes the stream

    def close(self) -> None:
        """Close the stream, and what carries it."""
        if self._stream is not None:
            self._dropped += self._stream.dropped
        self._release()
        self._stream = None

    @abstractmethod
    def _release(self) -> None:
        """Give the descriptor back."""

    def _exchange(self, stream: Stream, ready: frozenset[int], now: float) -> list[Arrival]:
        """Write what waits, and read what has come."""
        try:
            stream.flush()
            frames = stream.read(now, is_readable=stream.descriptor in ready)
        except StreamEndedError as error:
            self._lose(str(error), now)
            return []
        if frames:
            self._retry.proven()
        return [(self._address, frame) for frame in frames]

    def _lose(self, reason: str, now: float) -> None:
        self.close()
        self._retry.failed(now, reason)
