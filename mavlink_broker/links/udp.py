"""MAVLink over UDP: one socket that listens, or one that sends first."""

import errno
import logging
import socket
from collections.abc import Callable
from typing import Any, Final

from mavlink_broker.links.link import Arrival, HostName, LinkError, PortBusyError
from mavlink_broker.links.url import ANY_ADDRESS, Address, LinkKind, LinkUrl

RECEIVE_BUFFER_BYTES: Final = 1 << 20
MAX_DATAGRAM_BYTES: Final = 4096
"""Longer ones are truncated: no sender packs more frames than a network packet holds."""
MAX_DATAGRAMS_PER_READ: Final = 256
"""Limit of one step, so that a flood cannot block the loop."""

_LOG = logging.getLogger(__name__)


class UdpLink:
    """Implements `mavlink_broker.links.link.Link` with one socket for all peers."""

    def __init__(self, url: LinkUrl, number: int, on_found: Callable[[], None]) -> None:
        """Bind a socket.

        Raises:
            LinkError: if it cannot listen there; PortBusyError if another program uses the port.
        """
        self.url = url
        self._number = number
        self._target: HostName | None = None
        here = (url.host, url.port)
        if url.kind is LinkKind.UDP_OUT:
            family = socket.AF_INET6 if ":" in url.host else socket.AF_INET
            self._target = HostName(url.host, on_found, family)
            here = ("::" if ":" in url.host else ANY_ADDRESS, 0)
        family = socket.AF_INET6 if ":" in here[0] else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.settimeout(0.0)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)  # Some modems need it
        bind(self._socket, here, url)
        self._now = 0.0

    @property
    def dropped(self) -> int:
        """0: there is no queue, and losses in the network are not known."""
        return 0

    @property
    def port(self) -> int:
        """Port that it is bound to."""
        port: int = self._socket.getsockname()[1]
        return port

    def readers(self) -> list[int]:
        """The socket."""
        return [self._socket.fileno()]

    def writers(self) -> list[int]:
        """None: datagrams are not queued."""
        return []

    def due_at(self) -> float | None:
        """None: it has no timer."""
        return None

    def radio_status(self, free_percent: int) -> None:
        """Ignored: the rate limit is for serial lines."""

    def contact_addresses(self) -> list[Address]:
        """The target of this link, once its address is known."""
        host = self._target.numeric(self._now) if self._target else None
        return [] if host is None else [Address(host, self.url.port, self._number)]

    def step(self, ready: frozenset[int], now: float) -> list[Arrival]:
        """Return the received datagrams."""
        self._now = now
        return self._datagrams() if self._socket.fileno() in ready else []

    def send(self, address: Address, frame: bytes) -> None:
        """Send one frame; a datagram that cannot be sent is lost, as on any radio."""
        try:
            self._socket.sendto(frame, (address.host, address.port))
        except OSError:
            return

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _datagrams(self) -> list[Arrival]:
        arrivals: list[Arrival] = []
        while len(arrivals) < MAX_DATAGRAMS_PER_READ:
            try:
                data, place = self._socket.recvfrom(MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                break
            except ConnectionError:
                continue  # ICMP answer to an earlier datagram: that port is closed
            except OSError as error:
                _LOG.warning("%s: %s", self.url, error)
                break
            arrivals.append((Address(place[0], place[1], self._number), data))
        return arrivals


def bind(one: socket.socket, here: tuple[Any, ...], url: LinkUrl) -> None:
    """Bind a socket; closes it if that fails.

    Raises:
        LinkError: if it cannot listen there; PortBusyError if another program uses the port.
    """
    try:
        one.bind(here)
    except OSError as error:
        one.close()
        protocol = "UDP" if url.kind in {LinkKind.UDP_IN, LinkKind.UDP_OUT} else "TCP"
        if error.errno == errno.EADDRINUSE:
            text = f"{protocol} port {url.port} is in use by another program"
            raise PortBusyError(text) from error
        hint = "; use udpout:// or tcp:// to connect to another machine"
        reason = f"{error.strerror}{hint if error.errno == errno.EADDRNOTAVAIL else ''}"
        raise LinkError(f"{url}: cannot listen there: {reason}") from error
