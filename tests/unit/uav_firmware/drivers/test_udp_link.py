import sys
from collections.abc import Iterator

import pytest

from uav_firmware.drivers.udp_link import MAX_DATAGRAMS_PER_CALL, UdpLink

HOST = "127.0.0.1"


@pytest.fixture
def links() -> Iterator[tuple[UdpLink, UdpLink]]:
    one, other = UdpLink(HOST, 0), UdpLink(HOST, 0)
    yield one, other
    one.close()
    other.close()


def test_a_datagram_arrives_with_its_sender(links: tuple[UdpLink, UdpLink]) -> None:
    one, other = links
    one.send(b"hello", other.address)
    assert other.wait(1.0)
    assert list(other.receive()) == [(b"hello", one.address)]


def test_receiving_never_blocks(links: tuple[UdpLink, UdpLink]) -> None:
    assert list(links[0].receive()) == []
    assert not links[0].wait(0.0)
    assert not links[0].wait(-1.0)


def test_datagrams_keep_their_borders(links: tuple[UdpLink, UdpLink]) -> None:
    one, other = links
    for size in (1, 0, 300):
        one.send(bytes(size), other.address)
    assert other.wait(1.0)
    assert [len(datagram) for datagram, _ in other.receive()] == [1, 0, 300]


def test_a_flood_is_served_in_slices(links: tuple[UdpLink, UdpLink]) -> None:
    one, other = links
    for _ in range(MAX_DATAGRAMS_PER_CALL + 10):
        one.send(b"x", other.address)
    assert other.wait(1.0)
    assert len(other.receive()) == MAX_DATAGRAMS_PER_CALL
    assert len(other.receive()) == 10


def test_nobody_listening_is_no_error(links: tuple[UdpLink, UdpLink]) -> None:
    one, other = links
    gone = other.address
    other.close()
    for _ in range(3):
        one.send(b"anybody?", gone)
        assert list(one.receive()) == []


@pytest.mark.parametrize("address", [("256.0.0.1", 1), ("127.0.0.1", 0)])
def test_an_impossible_address_is_counted_and_no_error(
    links: tuple[UdpLink, UdpLink], address: tuple[str, int]
) -> None:
    links[0].send(b"x", address)
    assert links[0].send_faults == 1


def test_a_datagram_too_large_for_udp_is_counted_and_no_error(
    links: tuple[UdpLink, UdpLink],
) -> None:
    one, other = links
    one.send(bytes(70_000), other.address)
    assert one.send_faults == 1


def test_a_port_in_use_is_refused(links: tuple[UdpLink, UdpLink]) -> None:
    with pytest.raises(OSError, match="in use"):
        UdpLink(*links[0].address)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux reports it")
def test_where_nobody_listens_is_told_once(links: tuple[UdpLink, UdpLink]) -> None:
    one, other = links
    gone = other.address
    other.close()
    one.send(b"anybody?", gone)
    assert list(one.refused_addresses()) == [gone]
    assert list(one.refused_addresses()) == []


def test_a_datagram_for_another_is_not_lost_to_who_does_not_listen(
    links: tuple[UdpLink, UdpLink],
) -> None:
    one, other = links
    gone = UdpLink(HOST, 0)
    nowhere = gone.address
    gone.close()
    for number in range(5):
        one.send(b"anybody?", nowhere)
        one.send(bytes((number,)), other.address)
    assert other.wait(1.0)
    assert [datagram for datagram, _ in other.receive()] == [bytes((n,)) for n in range(5)]
    assert list(one.receive()) == []
