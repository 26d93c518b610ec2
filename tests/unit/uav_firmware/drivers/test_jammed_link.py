"""A link that a fault cuts, over real sockets."""

from collections.abc import Iterator

import pytest

from uav_firmware.cal.link import Address
from uav_firmware.drivers.jammed_link import JammedLink
from uav_firmware.drivers.udp_link import UdpLink


class Switch:
    """A vehicle whose link can be cut."""

    link_lost = False

    def inject(self, unit: int, failure_type: int, instance: int) -> bool:
        return (unit, failure_type, instance) == (105, 1, 0)


class Pair:
    """The vehicle's end and a peer."""

    def __init__(self) -> None:
        self.switch = Switch()
        self.link = JammedLink(UdpLink("127.0.0.1", 0), self.switch)
        self.peer = UdpLink("127.0.0.1", 0)

    def peer_hears(self, datagram: bytes) -> bool:
        self.link.send(datagram, self.peer.address)
        self.peer.wait(0.05)
        return any(heard == datagram for heard, _ in self.peer.receive())

    def hears(self, datagram: bytes) -> list[tuple[bytes, Address]]:
        self.peer.send(datagram, self.link.address)
        self.link.wait(1.0)
        return list(self.link.receive())


@pytest.fixture
def pair() -> Iterator[Pair]:
    made = Pair()
    yield made
    made.link.close()
    made.peer.close()


def test_a_whole_link_carries_both_ways(pair: Pair) -> None:
    assert pair.peer_hears(b"down")
    assert pair.hears(b"up") == [(b"up", pair.peer.address)]


def test_a_cut_link_carries_nothing_and_brings_nothing_later(pair: Pair) -> None:
    pair.switch.link_lost = True
    assert not pair.peer_hears(b"down")
    assert pair.hears(b"up") == []
    pair.switch.link_lost = False
    assert list(pair.link.receive()) == []
    assert pair.hears(b"again") == [(b"again", pair.peer.address)]
