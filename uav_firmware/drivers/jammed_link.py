"""A link that a fault can cut: datagrams vanish in both directions, as out of radio range."""

from collections.abc import Sequence

from uav_firmware.cal.faults import FaultInjector
from uav_firmware.cal.link import Address
from uav_firmware.drivers.udp_link import UdpLink


class JammedLink:
    """Implements `uav_firmware.cal.link.Link` on a UDP link; the vehicle says when it is cut.

    What arrives meanwhile is taken and dropped, so that it does not come late either.
    """

    def __init__(self, link: UdpLink, vehicle: FaultInjector) -> None:
        self._link = link
        self._vehicle = vehicle

    @property
    def address(self) -> Address:
        """Address that the socket is bound to."""
        return self._link.address

    def receive(self) -> Sequence[tuple[bytes, Address]]:
        """All datagrams that have arrived, none while the link is cut."""
        datagrams = self._link.receive()
        return () if self._vehicle.link_lost else datagrams

    def send(self, datagram: bytes, address: Address) -> None:
        """Send one datagram; drop it while the link is cut."""
        if not self._vehicle.link_lost:
            self._link.send(datagram, address)

    def refused_addresses(self) -> Sequence[Address]:
        """Addresses where no process listens."""
        return self._link.refused_addresses()

    def wait(self, seconds: float) -> bool:
        """Wait for datagrams no longer than `seconds`; whether there are some."""
        return self._link.wait(seconds)

    def close(self) -> None:
        """Release the socket."""
        self._link.close()
