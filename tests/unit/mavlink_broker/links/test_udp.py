"""UDP links: answers go to the sender of a datagram, a wake-up ends a wait."""

import socket
import threading

import pytest

from mavlink_broker.links.hub import Hub, open_links
from mavlink_broker.links.link import LinkError, PortBusyError
from mavlink_broker.links.url import Address, LinkUrl
from tests.support.descriptors import many_open_files
from tests.support.link_ends import receive_until

HOST = "127.0.0.1"


def listening(port: int = 0) -> Hub:
    return open_links([LinkUrl.parse(f"udpin://{HOST}:{port}")])


def test_datagrams_have_their_sender_and_answers_reach_it() -> None:
    link = listening()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.settimeout(5.0)
        vehicle.bind((HOST, 0))
        vehicle.sendto(b"one", (HOST, link.urls[0].port))
        ((address, datagram),) = link.receive(5.0)
        assert (address[:2], datagram) == (vehicle.getsockname(), b"one")
        link.send(address, b"two")
        assert vehicle.recv(100) == b"two"
    link.close()


def test_a_datagram_is_received_where_many_files_are_open() -> None:
    with many_open_files(), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        link = listening()
        vehicle.sendto(b"one", (HOST, link.urls[0].port))
        ((_, datagram),) = link.receive(5.0)
        assert datagram == b"one"
        link.wake()
        assert link.receive(5.0) == []
        link.close()


def test_a_wake_up_from_another_thread_ends_the_wait() -> None:
    link = listening()
    thread = threading.Thread(target=link.wake)
    thread.start()
    assert link.receive(30.0) == []
    thread.join()
    link.close()


def test_several_wake_ups_end_one_wait() -> None:
    link = listening()
    for _ in range(10_000):
        link.wake()
    link.receive(0.0)
    link.close()


def test_a_vehicle_that_is_gone_is_no_error() -> None:
    link = listening()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind((HOST, 0))
        gone = Address(*vehicle.getsockname())
    for _ in range(3):
        link.send(gone, b"anybody?")
        assert link.receive(0.01) == []
    link.close()


def test_a_busy_port_is_reported() -> None:
    link = listening()
    with pytest.raises(PortBusyError, match=f"UDP port {link.urls[0].port} is in use"):
        listening(link.urls[0].port)
    link.close()


def test_listening_on_an_address_of_another_machine_fails() -> None:
    with pytest.raises(LinkError, match="cannot listen there"):
        open_links([LinkUrl.parse("udpin://192.0.2.1:0")])


def test_the_target_of_an_outgoing_link_is_a_contact_address() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.settimeout(5.0)
        vehicle.bind((HOST, 0))
        link = open_links([LinkUrl.parse(f"udpout://localhost:{vehicle.getsockname()[1]}")])
        receive_until(link, lambda _: bool(link.contact_addresses()))
        (address,) = link.contact_addresses()
        link.send(address, b"hello")
        data, broker = vehicle.recvfrom(100)
        assert data == b"hello"
        vehicle.sendto(b"here", broker)
        assert receive_until(link, bool) == [(address, b"here")]
        link.close()


def test_version_6_addresses_are_links_too() -> None:
    link = open_links([LinkUrl.parse("udpin://[::1]:0")])
    with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as vehicle:
        vehicle.settimeout(5.0)
        vehicle.sendto(b"one", ("::1", link.urls[0].port))
        ((address, datagram),) = receive_until(link, bool)
        assert datagram == b"one"
        link.send(address, b"two")
        assert vehicle.recv(100) == b"two"
    link.close()


def test_several_links_are_received_at_once() -> None:
    link = open_links([LinkUrl.parse(f"udpin://{HOST}:0"), LinkUrl.parse(f"tcpin://{HOST}:0")])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.sendto(b"datagram", (HOST, link.urls[0].port))
        ((address, _),) = receive_until(link, bool)
    assert address.link == 0
    link.close()
