"""One UDP socket: answers go where a vehicle was heard, a wake-up ends a wait."""

import socket
import threading

import pytest

from mavlink_broker.link import PortBusyError, UdpLink

HOST = "127.0.0.1"


def test_datagrams_come_with_their_sender_and_answers_reach_it() -> None:
    link = UdpLink(HOST, 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.settimeout(5.0)
        vehicle.bind((HOST, 0))
        vehicle.sendto(b"one", (HOST, link.port))
        ((address, datagram),) = link.receive(5.0)
        assert (address, datagram) == (vehicle.getsockname(), b"one")
        link.send(address, b"two")
        assert vehicle.recv(100) == b"two"
    link.close()


def test_a_wake_up_from_another_thread_ends_the_wait() -> None:
    link = UdpLink(HOST, 0)
    thread = threading.Thread(target=link.wake)
    thread.start()
    assert link.receive(30.0) == []
    thread.join()
    link.close()


def test_any_number_of_wake_ups_is_one() -> None:
    link = UdpLink(HOST, 0)
    for _ in range(10_000):
        link.wake()
    link.receive(0.0)
    link.close()


def test_a_vehicle_that_is_gone_is_no_error() -> None:
    link = UdpLink(HOST, 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind((HOST, 0))
        gone = vehicle.getsockname()
    for _ in range(3):
        link.send(gone, b"anybody?")
        assert link.receive(0.01) == []
    link.close()


def test_a_busy_port_is_told_in_a_sentence() -> None:
    link = UdpLink(HOST, 0)
    with pytest.raises(PortBusyError, match=f"UDP port {link.port} is in use"):
        UdpLink(HOST, link.port)
    link.close()
