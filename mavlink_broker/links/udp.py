"""MAVLink over UDP: one socket that listens, or one that speaks first."""

import errno
import logging
import socket
from collections.abc import Callable
from typing import Any, Final

from mavlink_broker.links.link import Arrival, LinkError, PortBusyError
from mavlink_broker.links.name_lookup import HostName
from mavlink_broker.links.url import EVERYBODY, Address, LinkKind, LinkUrl

RECEIVE_BUFFER_BYTES: Final = 1 << 20
LARGEST_DATAGRAM_BYTES: Final = 4096
"""Longer ones are cut: no sender packs more frames than a network packet holds."""
DATAGRAMS_AT_ONCE: Final = 256
"""So that a flood cannot keep the loop from its other duties."""

_LOG = logging.getLogger(__name__)


class UdpLink:
    """Implements `mavlink_broker.links.link.Link` with a socket for all correspondents."""

    def __init__(self, url: LinkUrl, number: int, on_found: Callable[[], None]) -> None:
        """Bind a socket.

        Raises:
            LinkError: if it cannot listen there; PortBusyError if another program does.
        """
        self.url = url
        self._number = number
        self._target: HostName | None = None
        here = (url.host, url.port)
        if url.kind is LinkKind.UDP_OUT:
            family = socket.AF_INET6 if ":" in url.host else socket.AF_INET
            self._target = HostName(url.host, on_found, family)
            here = ("::" if ":" in url.host else EVERYBODY, 0)
        family = socket.AF_INET6 if ":" in here[0] else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.settimeout(0.0)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)  # Modems wait for that
        bind(self._socket, here, url)
        self._now = 0.0

    @property
    def dropped(self) -> int:
        """Nothing waits, so nothing is given up: what the network drops nobody knows."""
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
        """A datagram never waits."""
        return []

    def due_at(self) -> float | None:
        """Nothing is done unasked."""
        return None

    def radio(self, free_percent: int) -> None:
        """Networks keep a pace of their own."""

    def greeted(self) -> list[Address]:
        """Whom this link was made for, once his address is known."""
        host = self._target.numeric(self._now) if self._target else None
        return [] if host is None else [Address(host, self.url.port, self._number)]

    def step(self, ready: frozenset[int], now: float) -> list[Arrival]:
        """Give the datagrams that are there."""
        self._now = now
        return self._datagrams() if self._socket.fileno() in ready else []

    def send(self, address: Address, frame: bytes) -> None:
        """Send one frame; a datagram that cannot leave is a lost one, as on any radio."""
        try:
            self._socket.sendto(frame, (address.host, address.port))
        except OSError:
            return

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()

    def _datagrams(self) -> list[Arrival]:
        arrivals: list[Arrival] = []
        while len(arrivals) < DATAGRAMS_AT_ONCE:
            try:
                data, place = self._socket.recvfrom(LARGEST_DATAGRAM_BYTES)
            except BlockingIOError:
                break
            except ConnectionError:
                continue  # The answer to an earlier datagram: that port is closed
            except OSError as error:
                _LOG.warning("%s: %s", self.url, error)
                break
            arrivals.append((Address(place[0], place[1], self._number), data))
        return arrivals


def bind(one: socket.socket, here: tuple[Any, ...], url: LinkUrl) -> None:
    """Bind a socket to a place, or close it.

    Raises:
        LinkError: if it cannot listen there; PortBusyError if another program does.
    """
    try:
        one.bind(here)
    except OSError as error:
        one.close()
        protocol = "UDP" if url.kind in {LinkKind.UDP_IN, LinkKind.UDP_OUT} else "TCP"
        if error.errno == errno.EADDRINUSE:
            text = f"{protocol} port {url.port} is in use by another program"
            raise PortBusyError(text) from error
        hint = "; udpout:// and tcp:// speak to another machine"
        reason = f"{error.strerror}{hint if error.errno == errno.EADDRNOTAVAIL else ''}"
        raise LinkError(f"{url}: cannot listen there: {reason}") from error
