"""A link that an injected fault interrupts: datagrams are lost in both directions."""

from collections.abc import Sequence

from uav_firmware.cal.faults import FaultInjector
from uav_firmware.cal.link import Address
from uav_firmware.drivers.udp_link import UdpLink


class JammedLink:
    """Implements `uav_firmware.cal.link.Link` on a UDP link; interrupted while `link_lost` is set.

    Datagrams that arrive meanwhile are dropped, so that they are not delivered late.
    """

    def __init__(self, link: UdpLink, vehicle: FaultInjector) -> None:
        self._link = link
        self._vehicle = vehicle

    @property
    def address(self) -> Address:
        """Address that the socket is bound to."""
        return self._link.address

    def receive(self) -> Sequence[tuple[bytes, Address]]:
        """All datagrams that have arrived, none while the link is interrupted."""
        datagrams = self._link.receive()
        return () if self._vehicle.link_lost else datagrams

    def send(self, datagram: bytes, address: Address) -> None:
        """Send one datagram; drop it while the link is interrupted."""
        if not self._vehicle.link_lost:
            self._link.send(datagram, address)

    def refused_addresses(self) -> Sequence[Address]:
        """Addresses where no process listens."""
        return self._link.refused_addresses()

    def wait(self, seconds: float) -> bool:
        """Wait for datagrams no longer than `seconds`; return whether there are some."""
        return self._link.wait(seconds)

    def close(self) -> None:
        """Release the socket."""
        self._link.close()
