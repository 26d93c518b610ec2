"""A link to a peer by name, over real sockets on several loopback addresses."""

from collections.abc import Iterator

import pytest

from uav_firmware.cal.link import Address
from uav_firmware.drivers.named_link import NamedLink, PeerResolver
from uav_firmware.drivers.udp_link import UdpLink

OLD, NEW = "127.0.0.2", "127.0.0.3"


class Farm:
    """A vehicle's link and a broker that can come back at another address."""

    def __init__(self) -> None:
        self.at: str | None = OLD
        self.broker = UdpLink(OLD, 0)
        self.peer: Address = ("broker", self.broker.address[1])
        self.resolver = PeerResolver([self.peer], self.resolve)
        self.link = NamedLink("127.0.0.1", 0, self.resolver)

    def resolve(self, _host: str) -> str:
        if self.at is None:
            raise OSError("no such host")
        return self.at

    def move_broker(self) -> None:
        self.broker.close()
        self.broker = UdpLink(NEW, self.peer[1])
        self.at = NEW

    def broker_hears(self, datagram: bytes) -> bool:
        self.link.send(datagram, self.peer)
        return self.broker.wait(1.0) and (datagram, self.link.address) in self.broker.receive()

    def close(self) -> None:
        self.link.close()
        self.broker.close()


@pytest.fixture
def farm() -> Iterator[Farm]:
    made = Farm()
    yield made
    made.close()


def test_the_peer_is_reached_by_its_name_and_answers_under_it(farm: Farm) -> None:
    assert farm.broker_hears(b"heartbeat")
    farm.broker.send(b"answer", farm.link.address)
    assert farm.link.wait(1.0)
    assert farm.link.receive() == [(b"answer", farm.peer)]


def test_a_peer_that_comes_back_elsewhere_is_found_again(farm: Farm) -> None:
    farm.move_broker()
    farm.resolver.resolve()
    assert farm.broker_hears(b"heartbeat")


def test_a_closed_port_is_reported_with_the_peers_name(farm: Farm) -> None:
    farm.broker.close()
    farm.link.send(b"anybody", farm.peer)
    farm.link.wait(1.0)
    assert farm.peer in farm.link.refused_addresses()


def test_an_unknown_sender_keeps_its_number(farm: Farm) -> None:
    stranger = UdpLink("127.0.0.1", 0)
    stranger.send(b"hello", farm.link.address)
    assert farm.link.wait(1.0)
    assert farm.link.receive() == [(b"hello", stranger.address)]
    farm.link.send(b"you too", stranger.address)
    assert stranger.wait(1.0)
    stranger.close()


def test_what_is_sent_to_a_name_without_an_address_is_lost_and_counted() -> None:
    def resolve(_host: str) -> str:
        raise OSError("no such host")

    link = NamedLink("127.0.0.1", 0, PeerResolver([("broker", 9)], resolve))
    link.send(b"heartbeat", ("broker", 9))
    assert link.send_faults == 1
    link.close()


BROKER: Address = ("broker", 14540)
GCS: Address = ("tablet", 14550)


class NameServer:
    """Resolves the given names; another name is an error, as in the system's."""

    def __init__(self, **hosts: str) -> None:
        self.hosts = hosts

    def __call__(self, host: str) -> str:
        if host not in self.hosts:
            raise OSError("no such host")
        return self.hosts[host]


def test_a_peer_is_translated_both_ways() -> None:
    resolver = PeerResolver([BROKER], NameServer(broker="10.0.0.2"))
    resolver.resolve()
    assert resolver.numeric(BROKER) == ("10.0.0.2", 14540)
    assert resolver.named(("10.0.0.2", 14540)) == BROKER


def test_another_port_of_the_same_host_is_another_sender() -> None:
    resolver = PeerResolver([BROKER], NameServer(broker="10.0.0.2"))
    resolver.resolve()
    assert resolver.named(("10.0.0.2", 9)) == ("10.0.0.2", 9)


def test_strangers_keep_their_address() -> None:
    resolver = PeerResolver([BROKER], NameServer(broker="10.0.0.2"))
    resolver.resolve()
    assert resolver.numeric(("10.0.0.9", 14550)) == ("10.0.0.9", 14550)


def test_a_silent_peer_is_found_at_its_new_address_and_no_longer_at_the_old() -> None:
    names = NameServer(broker="10.0.0.2")
    resolver = PeerResolver([BROKER], names)
    resolver.resolve()
    names.hosts["broker"] = "10.0.0.7"
    resolver.resolve()
    assert resolver.numeric(BROKER) == ("10.0.0.7", 14540)
    assert resolver.named(("10.0.0.7", 14540)) == BROKER
    assert resolver.named(("10.0.0.2", 14540)) == ("10.0.0.2", 14540)


def test_an_active_peer_keeps_its_address_and_is_resolved_once_it_is_silent() -> None:
    names = NameServer(broker="10.0.0.2")
    resolver = PeerResolver([BROKER], names)
    resolver.resolve()
    names.hosts["broker"] = "10.0.0.7"
    resolver.mark_active(BROKER)
    resolver.resolve()
    assert resolver.numeric(BROKER) == ("10.0.0.2", 14540)
    resolver.resolve()
    assert resolver.numeric(BROKER) == ("10.0.0.7", 14540)


def test_a_name_that_has_gone_keeps_its_last_address() -> None:
    names = NameServer(broker="10.0.0.2")
    resolver = PeerResolver([BROKER], names)
    resolver.resolve()
    del names.hosts["broker"]
    resolver.resolve()
    assert resolver.numeric(BROKER) == ("10.0.0.2", 14540)


def test_a_name_without_an_address_does_not_hide_another_peer() -> None:
    resolver = PeerResolver([BROKER, GCS], NameServer(tablet="10.0.0.3"))
    resolver.resolve()
    assert resolver.numeric(BROKER) is None
    assert resolver.numeric(GCS) == ("10.0.0.3", 14550)
