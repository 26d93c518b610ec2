"""What every link gives to the hub, and what may be wrong with one.

LinkError
└── PortBusyError   another program listens there
"""

import logging
from typing import Final, Protocol, TypeAlias

from mavlink_broker.links.url import Address, LinkUrl

FIRST_RETRY_S: Final = 0.5
LONGEST_RETRY_S: Final = 5.0

Arrival: TypeAlias = tuple[Address, bytes]
"""Bytes of whole frames, or a datagram of whatever, and whom they are from."""

_LOG = logging.getLogger(__name__)


class LinkError(Exception):
    """A link cannot be opened, and will not come by itself; the text says which and why."""


class PortBusyError(LinkError):
    """Another program listens there."""


class Link(Protocol):
    """One link; its methods never wait."""

    @property
    def url(self) -> LinkUrl:
        """As it was asked for."""

    @property
    def dropped(self) -> int:
        """Frames that could not be sent in time."""

    def readers(self) -> list[int]:
        """Descriptors that something may come from."""

    def writers(self) -> list[int]:
        """Descriptors that something waits to be sent to."""

    def due_at(self) -> float | None:
        """When it has something to do by itself."""

    def step(self, ready: frozenset[int], now: float) -> list[Arrival]:
        """Do what is due, and give what has come."""

    def send(self, address: Address, frame: bytes) -> None:
        """Send a frame; what cannot leave is lost, as on any radio."""

    def radio(self, free_percent: int) -> None:
        """Take a radio's word about how much of its buffer is free."""

    def greeted(self) -> list[Address]:
        """Who has to be spoken to first."""

    def close(self) -> None:
        """Give everything back."""


class Retry:
    """When a link is tried again: after growing pauses, for ever; each reason is told once."""

    def __init__(self, url: LinkUrl, longest_s: float = LONGEST_RETRY_S) -> None:
        self._url = url
        self._longest_s = longest_s
        self._pause_s = FIRST_RETRY_S
        self._told: str | None = None
        self.at = 0.0

    def failed(self, now: float, reason: str) -> None:
        """Wait a while."""
        if reason != self._told:
            _LOG.warning("%s: %s; it is tried again and again", self._url, reason)
        self._told = reason
        self.at = now + self._pause_s
        self._pause_s = min(2.0 * self._pause_s, self._longest_s)

    def opened(self) -> None:
        """Tell that it is open; whether it is worth anything shows later."""
        _LOG.info("%s is open", self._url)
        self._told = None

    def proven(self) -> None:
        """Begin with short pauses again: something sensible has come."""
        self._pause_s = FIRST_RETRY_S
