"""Common part of serial lines and outgoing TCP connections: one byte stream, one peer."""

from abc import ABC, abstractmethod

from mavlink_broker.links.link import Arrival, RetryTimer
from mavlink_broker.links.stream import Stream, StreamEndedError
from mavlink_broker.links.url import Address, LinkUrl


class SinglePeerLink(ABC):
    """A stream that may open and close again; the subclass opens it."""

    def __init__(self, url: LinkUrl, number: int, retry: RetryTimer) -> None:
        self.url = url
        self._address = Address(url.host, url.port, number)
        self._retry = retry
        self._stream: Stream | None = None
        self._dropped = 0

    @property
    def dropped(self) -> int:
        """Number of frames that could not be sent in time."""
        return self._dropped + (self._stream.dropped if self._stream else 0)

    def readers(self) -> list[int]:
        """The open stream."""
        return [self._stream.descriptor] if self._stream else []

    def contact_addresses(self) -> list[Address]:
        """The other end, while the stream is open."""
        return [self._address] if self._stream else []

    def send(self, address: Address, frame: bytes) -> None:
        """Send a frame, now or when the stream takes more."""
        del address
        if self._stream is None:
            return
        try:
            self._stream.send(frame)
        except StreamEndedError:
            return  # The next step gets the same error and closes the stream

    def close(self) -> None:
        """Close the stream and its descriptor."""
        if self._stream is not None:
            self._dropped += self._stream.dropped
        self._release()
        self._stream = None

    @abstractmethod
    def _release(self) -> None:
        """Close the descriptor."""

    def _transfer(self, stream: Stream, ready: frozenset[int], now: float) -> list[Arrival]:
        """Write what is queued and read what was received."""
        try:
            stream.flush()
            frames = stream.read(now, is_readable=stream.descriptor in ready)
        except StreamEndedError as error:
            self._disconnect(str(error), now)
            return []
        if frames:
            self._retry.reset()
        return [(self._address, frame) for frame in frames]

    def _disconnect(self, reason: str, now: float) -> None:
        self.close()
        self._retry.failed(now, reason)
