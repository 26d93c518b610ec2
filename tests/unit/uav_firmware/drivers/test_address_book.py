"""Peers that are known by name, and what they are called on the network."""

from uav_firmware.cal.link import Address
from uav_firmware.drivers.address_book import AddressBook

BROKER: Address = ("broker", 14540)
GCS: Address = ("tablet", 14550)


class NameServer:
    """Answers what it is told to; a name without an address is an error, as in the system's."""

    def __init__(self, **hosts: str) -> None:
        self.hosts = hosts

    def __call__(self, host: str) -> str:
        if host not in self.hosts:
            raise OSError("no such host")
        return self.hosts[host]


def test_a_peer_is_translated_both_ways() -> None:
    book = AddressBook([BROKER], NameServer(broker="10.0.0.2"))
    book.look_up()
    assert book.numeric(BROKER) == ("10.0.0.2", 14540)
    assert book.named(("10.0.0.2", 14540)) == BROKER


def test_another_port_of_the_same_host_is_another_sender() -> None:
    book = AddressBook([BROKER], NameServer(broker="10.0.0.2"))
    book.look_up()
    assert book.named(("10.0.0.2", 9)) == ("10.0.0.2", 9)


def test_strangers_keep_their_address() -> None:
    book = AddressBook([BROKER], NameServer(broker="10.0.0.2"))
    book.look_up()
    assert book.numeric(("10.0.0.9", 14550)) == ("10.0.0.9", 14550)


def test_a_silent_peer_is_found_at_its_new_address_and_no_longer_at_the_old() -> None:
    names = NameServer(broker="10.0.0.2")
    book = AddressBook([BROKER], names)
    book.look_up()
    names.hosts["broker"] = "10.0.0.7"
    book.look_up()
    assert book.numeric(BROKER) == ("10.0.0.7", 14540)
    assert book.named(("10.0.0.7", 14540)) == BROKER
    assert book.named(("10.0.0.2", 14540)) == ("10.0.0.2", 14540)


def test_a_peer_that_speaks_is_left_where_it_is_and_looked_up_once_it_is_silent() -> None:
    names = NameServer(broker="10.0.0.2")
    book = AddressBook([BROKER], names)
    book.look_up()
    names.hosts["broker"] = "10.0.0.7"
    book.note_heard(BROKER)
    book.look_up()
    assert book.numeric(BROKER) == ("10.0.0.2", 14540)
    book.look_up()
    assert book.numeric(BROKER) == ("10.0.0.7", 14540)


def test_a_name_that_has_gone_keeps_its_last_address() -> None:
    names = NameServer(broker="10.0.0.2")
    book = AddressBook([BROKER], names)
    book.look_up()
    del names.hosts["broker"]
    book.look_up()
    assert book.numeric(BROKER) == ("10.0.0.2", 14540)


def test_a_name_without_an_address_does_not_hide_another_peer() -> None:
    book = AddressBook([BROKER, GCS], NameServer(tablet="10.0.0.3"))
    book.look_up()
    assert book.numeric(BROKER) is None
    assert book.numeric(GCS) == ("10.0.0.3", 14550)
