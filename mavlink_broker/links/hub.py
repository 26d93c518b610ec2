"""All links of a program behind one door, with one place to wait at.

    hub = open_links(parse_links("udpin://0.0.0.0:14540 serial:///dev/ttyUSB0:57600"))
    for address, data in hub.receive(0.02): ...
    hub.send(address, frame)

`data` is a datagram, or a whole frame of a stream. An address says by its number which link it
is on. `wake` may be called from any thread and ends a wait at once, so that work from the edge
server is taken up without polling.
"""

import logging
import select
import socket
import time
from collections.abc import Callable, Sequence
from typing import Final

from mavlink_broker.links.link import Arrival, Link
from mavlink_broker.links.serial import SerialLink
from mavlink_broker.links.tcp import TcpClient, TcpListener
from mavlink_broker.links.udp import UdpLink
from mavlink_broker.links.url import Address, LinkKind, LinkUrl

TELL_EVERY_S: Final = 30.0
"""At most one line in half a minute about frames that a link did not take."""

_LOG = logging.getLogger(__name__)


class Hub:
    """The links, numbered in the order in which they were named."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._links: list[Link] = []
        self._told: dict[int, int] = {}
        self._tell_at = 0.0
        self._waker, self._woken = socket.socketpair()
        self._waker.settimeout(0.0)
        self._woken.settimeout(0.0)

    @property
    def urls(self) -> list[LinkUrl]:
        """The links as they were asked for; port 0 as the port that it became."""
        return [
            link.url._replace(port=getattr(link, "port", link.url.port)) for link in self._links
        ]

    @property
    def dropped(self) -> int:
        """Frames that some link did not take in time."""
        return sum(link.dropped for link in self._links)

    def add(self, url: LinkUrl) -> None:
        """Open one more link.

        Raises:
            LinkError: if it cannot be opened, and will not come by itself.
        """
        number = len(self._links)
        match url.kind:
            case LinkKind.UDP_IN | LinkKind.UDP_OUT:
                link: Link = UdpLink(url, number, self.wake)
            case LinkKind.TCP_OUT:
                link = TcpClient(url, number, self.wake)
            case LinkKind.TCP_IN:
                link = TcpListener(url, number)
            case LinkKind.SERIAL:
                link = SerialLink(url, number)
        self._links.append(link)

    def wake(self) -> None:
        """End a wait in `receive`; a full pipe is already as awake as can be."""
        try:
            self._waker.send(b"\0")
        except (BlockingIOError, OSError):
            return

    def receive(self, timeout_s: float) -> list[Arrival]:
        """Wait for something to come or a wake-up, at most so long, and give what is there."""
        ready = self._wait(timeout_s)
        now = self._clock()
        arrivals: list[Arrival] = []
        for link in self._links:
            arrivals += link.step(ready, now)
        if now >= self._tell_at:
            self._tell(now)
        return arrivals

    def send(self, address: Address, frame: bytes) -> None:
        """Send a frame; what cannot leave is lost, as on any radio."""
        self._links[address.link].send(address, frame)

    def radio(self, address: Address, free_percent: int) -> None:
        """Take the word of the radio at an address about how much of its buffer is free."""
        self._links[address.link].radio(free_percent)

    def greeted(self) -> list[Address]:
        """Who has to be spoken to first."""
        return [address for link in self._links for address in link.greeted()]

    def close(self) -> None:
        """Give everything back."""
        for link in self._links:
            link.close()
        for one in (self._waker, self._woken):
            one.close()

    def _wait(self, timeout_s: float) -> frozenset[int]:
        readers = [self._woken.fileno()]
        writers: list[int] = []
        for link in self._links:
            readers += link.readers()
            writers += link.writers()
        readable, writable, _ = select.select(readers, writers, [], self._patience(timeout_s))
        if readers[0] in readable:
            self._woken.recv(4096)
        return frozenset((*readable, *writable))

    def _patience(self, timeout_s: float) -> float:
        due = [at for link in self._links if (at := link.due_at()) is not None]
        return max(0.0, min(timeout_s, min(due) - self._clock())) if due else timeout_s

    def _tell(self, now: float) -> None:
        """Say which links did not take everything."""
        for number, link in enumerate(self._links):
            new = link.dropped - self._told.get(number, 0)
            if new:
                _LOG.warning("%s did not take %d frames", link.url, new)
                self._told[number] = link.dropped
                self._tell_at = now + TELL_EVERY_S


def open_links(urls: Sequence[LinkUrl], clock: Callable[[], float] = time.monotonic) -> Hub:
    """Open links; those that wait for a device or another program are tried for ever.

    Raises:
        LinkError: if one cannot be opened, and will not come by itself.
    """
    hub = Hub(clock)
    try:
        for url in urls:
            hub.add(url)
    except BaseException:
        hub.close()
        raise
    return hub
