"""A UDP link whose peers are known by name, whatever their address is at the moment."""

from collections.abc import Sequence

from uav_firmware.cal.link import Address
from uav_firmware.drivers.address_book import AddressBook
from uav_firmware.drivers.udp_link import UdpLink


class NamedLink(UdpLink):
    """Implements `uav_firmware.cal.link.Link`; a peer's address is its name and port for ever.

    Everybody else keeps the numeric address that the datagrams come from.
    """

    def __init__(self, host: str, port: int, book: AddressBook) -> None:
        """Bind to `host` and `port`, and look the peers of the book up.

        Raises:
            OSError: if the address cannot be bound.
        """
        super().__init__(host, port)
        self._book = book
        book.keep()

    def receive(self) -> Sequence[tuple[bytes, Address]]:
        """Datagrams that have arrived with their senders, at most 64 in a call."""
        return [(datagram, self._sender(address)) for datagram, address in super().receive()]

    def send(self, datagram: bytes, address: Address) -> None:
        """Send one datagram; to a name without an address it is lost, as on a radio."""
        if (numeric := self._book.numeric(address)) is None:
            self.send_faults += 1
        else:
            super().send(datagram, numeric)

    def refused_addresses(self) -> Sequence[Address]:
        """Where datagrams have been turned away since the last call."""
        return [self._book.named(address) for address in super().refused_addresses()]

    def close(self) -> None:
        """Release the socket and end the looking up."""
        self._book.close()
        super().close()

    def _sender(self, numeric: Address) -> Address:
        peer = self._book.named(numeric)
        if peer != numeric:
            self._book.note_heard(peer)
        return peer
