"""What links share: interface, errors, retry timer, resolver of host names, rate limit of a radio.

A name server may take long, so host names are resolved on a thread.

LinkError
└── PortBusyError   another program uses the port

`RateLimit` limits what is written to a radio by the free buffer in its RADIO_STATUS. A telemetry
radio reads the line faster than it transmits and discards what does not fit. As PX4 does with its
streams, the rate decreases in steps while the buffer fills and increases slowly while it is empty.
These reports are not signed, so a forged one may slow a line down to a tenth but never stops it.
"""

import logging
import socket
import threading
from collections.abc import Callable
from ipaddress import ip_address
from typing import Final, Protocol, TypeAlias

from mavlink_broker.links.url import Address, LinkUrl

FIRST_RETRY_S: Final = 0.5
MAX_RETRY_S: Final = 5.0
Arrival: TypeAlias = tuple[Address, bytes]
"""Sender, and a whole frame or a datagram with any content."""
_LOG = logging.getLogger(__name__)
LOOKUP_INTERVAL_S: Final = 30.0
"""Interval at which a known name is resolved again: a vehicle may return with another address."""
UNKNOWN_LOOKUP_INTERVAL_S: Final = 2.0
"""The same while the name is unknown."""


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
        """Follow RADIO_STATUS.txbuf of the link's radio: the free part of its buffer."""

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


class HostName:
    """A host, given as an address or a name."""

    def __init__(
        self, host: str, on_found: Callable[[], None], family: int = socket.AF_UNSPEC
    ) -> None:
        """Look up a host; `on_found` is called from a thread after each successful lookup."""
        self._host = host
        self._family = family
        self._on_found = on_found
        self._thread: threading.Thread | None = None
        self._next_at = 0.0
        self._numeric = host if _is_numeric(host) else None

    def numeric(self, now: float) -> str | None:
        """Latest numeric address; None while none is known."""
        if not _is_numeric(self._host) and now >= self._next_at and not self._is_resolving:
            self._next_at = now + (
                UNKNOWN_LOOKUP_INTERVAL_S if self._numeric is None else LOOKUP_INTERVAL_S
            )
            self._thread = threading.Thread(target=self._resolve, name="host-name", daemon=True)
            self._thread.start()
        return self._numeric

    @property
    def _is_resolving(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def _resolve(self) -> None:
        try:
            found = socket.getaddrinfo(self._host, None, self._family, socket.SOCK_DGRAM)
        except (OSError, UnicodeError):  # UnicodeError: the name is not a valid host name
            return
        self._numeric = str(found[0][4][0])
        self._on_found()


def _is_numeric(host: str) -> bool:
    try:
        ip_address(host)
    except ValueError:
        return False
    return True


LOW_FREE_PERCENT: Final = 25
HIGH_FREE_PERCENT: Final = 90
DECREASE: Final = 0.8
INCREASE: Final = 1.05
MIN_FACTOR: Final = 0.1
BITS_PER_BYTE: Final = 10
"""On a serial line: a start bit, eight bits, a stop bit."""
BURST_S: Final = 0.25


class RateLimiter:
    """How many bytes may be written; any number without a report or at the full rate."""

    def __init__(self, baud: int) -> None:
        self._line_bytes_s = baud / BITS_PER_BYTE
        self.factor = 1.0
        self._allowance_bytes = 0.0  # May be written at once
        self._at: float | None = None

    @property
    def bytes_s(self) -> float:
        """The current rate."""
        return self.factor * self._line_bytes_s

    def report(self, free_percent: int) -> None:
        """Follow RADIO_STATUS.txbuf, the free part of the radio's buffer."""
        if free_percent < LOW_FREE_PERCENT:
            self.factor = max(MIN_FACTOR, DECREASE * self.factor)
        elif free_percent > HIGH_FREE_PERCENT:
            self.factor = min(1.0, INCREASE * self.factor)

    def allows(self, now: float) -> bool:
        """Whether another frame may be written."""
        if self.factor >= 1.0:
            self._at, self._allowance_bytes = now, 0.0
            return True
        passed_s = 0.0 if self._at is None else now - self._at
        self._at = now
        self._allowance_bytes = min(
            self._allowance_bytes + passed_s * self.bytes_s, BURST_S * self.bytes_s
        )
        return self._allowance_bytes >= 0.0

    def written(self, count: int) -> None:
        """Count bytes that were written."""
        if self.factor < 1.0:
            self._allowance_bytes -= count
