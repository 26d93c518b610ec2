"""All links of a program behind one interface, with one call that waits for any of them.

    hub = open_links(parse_links("udpin://0.0.0.0:14540 serial:///dev/ttyUSB0:57600"))
    for address, data in hub.receive(0.02): ...
    hub.send(address, frame)

`data` is a datagram, or a whole frame of a stream. An address contains the number of its link.
`wake` may be called from any thread and ends a wait at once, so that work from the edge server
starts without polling.
"""

import logging
import math
import select
import socket
import time
from collections.abc import Callable, Sequence
from typing import Final

from mavlink_broker.links.link import Arrival, Link
from mavlink_broker.links.transports import SerialLink, TcpClient, TcpListener, UdpLink
from mavlink_broker.links.url import Address, LinkKind, LinkUrl
from mavlink_broker.supervision import InternalErrors

REPORT_INTERVAL_S: Final = 30.0
"""Interval of log lines about dropped frames."""

_LOG = logging.getLogger(__name__)


class Hub:
    """The links, numbered in the order in which they were named."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._links: list[Link] = []
        self._errors = InternalErrors()
        self._reported: dict[int, int] = {}
        self._report_at = 0.0
        self._wakeup_sender, self._wakeup_receiver = socket.socketpair()
        self._wakeup_sender.settimeout(0.0)
        self._wakeup_receiver.settimeout(0.0)

    @property
    def urls(self) -> list[LinkUrl]:
        """The configured links; port 0 is replaced by the port that the system chose."""
        return [link.url._replace(port=link.port) for link in self._links]

    def add(self, url: LinkUrl) -> None:
        """Open one more link.

        Raises:
            LinkError: if it cannot be opened and retrying cannot help.
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
        """End a wait in `receive`; a full pipe already ends it."""
        try:
            self._wakeup_sender.send(b"\0")
        except (BlockingIOError, OSError):
            return

    def receive(self, timeout_s: float) -> list[Arrival]:
        """Wait for data or a wake-up, at most `timeout_s`, and return what was received."""
        ready = self._wait(timeout_s)
        now = self._clock()
        arrivals: list[Arrival] = []
        for link in self._links:
            try:
                arrivals += link.step(ready, now)
            except Exception as error:  # noqa: BLE001  # the boundary of one link
                self._errors.record(str(link.url), error, now)
        if now >= self._report_at:
            self._log_dropped(now)
        return arrivals

    def send(self, address: Address, frame: bytes) -> None:
        """Send a frame; a frame that cannot be sent is lost, as on any radio."""
        self._links[address.link].send(address, frame)

    def radio_status(self, address: Address, free_percent: int) -> None:
        """Pass on RADIO_STATUS.txbuf of the radio at an address: the free part of its buffer."""
        self._links[address.link].radio_status(free_percent)

    def contact_addresses(self) -> list[Address]:
        """Addresses to which this side must send before it can receive."""
        return [address for link in self._links for address in link.contact_addresses()]

    def close(self) -> None:
        """Close all links."""
        for link in self._links:
            link.close()
        for one in (self._wakeup_sender, self._wakeup_receiver):
            one.close()

    def _wait(self, timeout_s: float) -> frozenset[int]:
        """Wait until a descriptor is ready; the timeout is rounded up to whole milliseconds."""
        wakeup = self._wakeup_receiver.fileno()
        events = {wakeup: select.POLLIN}
        for link in self._links:
            events |= dict.fromkeys(link.readers(), select.POLLIN)
        for link in self._links:
            for writer in link.writers():
                events[writer] = events.get(writer, 0) | select.POLLOUT
        poll = select.poll()  # Not `select`, which raises for a descriptor above 1023
        for descriptor, mask in events.items():
            poll.register(descriptor, mask)
        ready = frozenset(
            one for one, _ in poll.poll(math.ceil(self._wait_timeout_s(timeout_s) * 1000))
        )
        if wakeup in ready:
            self._wakeup_receiver.recv(4096)
        return ready

    def _wait_timeout_s(self, timeout_s: float) -> float:
        due = [at for link in self._links if (at := link.due_at()) is not None]
        return max(0.0, min(timeout_s, min(due) - self._clock())) if due else timeout_s

    def _log_dropped(self, now: float) -> None:
        """Log which links have dropped frames since the last line."""
        for number, link in enumerate(self._links):
            new = link.dropped - self._reported.get(number, 0)
            if new:
                _LOG.warning("%s: dropped %d frames", link.url, new)
                self._reported[number] = link.dropped
                self._report_at = now + REPORT_INTERVAL_S


def open_links(urls: Sequence[LinkUrl], clock: Callable[[], float] = time.monotonic) -> Hub:
    """Open links; a link that waits for a device or another program retries without end.

    Raises:
        LinkError: if one cannot be opened and retrying cannot help.
    """
    hub = Hub(clock)
    try:
        for url in urls:
            hub.add(url)
    except BaseException:
        hub.close()
        raise
    return hub
