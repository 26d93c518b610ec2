"""The interface of a link, its errors and its retry timer.

LinkError
└── PortBusyError   another program uses the port
"""

import logging
from typing import Final, Protocol, TypeAlias

from mavlink_broker.links.url import Address, LinkUrl

FIRST_RETRY_S: Final = 0.5
MAX_RETRY_S: Final = 5.0

Arrival: TypeAlias = tuple[Address, bytes]
"""Sender, and a whole frame or a datagram with any content."""

_LOG = logging.getLogger(__name__)


class LinkError(Exception):
    """A link cannot be opened and retrying cannot help; the text says which link and why."""


class PortBusyError(LinkError):
    """Another program uses the port."""


class Link(Protocol):
    """One link; its methods never block."""

    @property
    def url(self) -> LinkUrl:
        """The URL that was configured."""

    @property
    def dropped(self) -> int:
        """Number of frames that could not be sent in time."""

    def readers(self) -> list[int]:
        """File descriptors to read from."""

    def writers(self) -> list[int]:
        """File descriptors for which data waits to be sent."""

    def due_at(self) -> float | None:
        """Time of its next timer; None if it has none."""

    def step(self, ready: frozenset[int], now: float) -> list[Arrival]:
        """Do what is due and return what was received."""

    def send(self, address: Address, frame: bytes) -> None:
        """Send a frame; a frame that cannot be sent is lost, as on any radio."""

    def radio_status(self, free_percent: int) -> None:
        """Take RADIO_STATUS.txbuf of the link's radio: the free part of its buffer."""

    def contact_addresses(self) -> list[Address]:
        """Addresses to which this side must send before it can receive."""

    def close(self) -> None:
        """Close its sockets and devices."""


class RetryTimer:
    """When a link is opened again: after growing pauses, without end; logs each reason once."""

    def __init__(self, url: LinkUrl, longest_s: float = MAX_RETRY_S) -> None:
        self._url = url
        self._longest_s = longest_s
        self._pause_s = FIRST_RETRY_S
        self._reported: str | None = None
        self.at = 0.0

    def failed(self, now: float, reason: str) -> None:
        """Start the next pause."""
        if reason != self._reported:
            _LOG.warning("%s: %s; retrying", self._url, reason)
        self._reported = reason
        self.at = now + self._pause_s
        self._pause_s = min(2.0 * self._pause_s, self._longest_s)

    def opened(self) -> None:
        """Log that it is open; the pauses start again from the shortest only with `reset`."""
        _LOG.info("%s is open", self._url)
        self._reported = None

    def reset(self) -> None:
        """Use short pauses again: a frame was received."""
        self._pause_s = FIRST_RETRY_S
