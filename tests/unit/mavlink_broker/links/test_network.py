"""TCP links: outgoing and incoming connections. UDP links: answers go to the sender."""

import logging
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from mavlink_broker.links.hub import Hub, open_links
from mavlink_broker.links.link import LinkError, PortBusyError
from mavlink_broker.links.network import MAX_CLIENTS
from mavlink_broker.links.url import Address, LinkUrl
from mavlink_broker.mavlink.codec import Encoder
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.descriptors import many_open_files
from tests.support.link_ends import PATIENCE_S, receive_until

HOST = "127.0.0.1"
FRAME = Encoder(1, 1).encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))


@contextmanager
def opened(url: str) -> Iterator[Hub]:
    hub = open_links([LinkUrl.parse(url)])
    try:
        yield hub
    finally:
        hub.close()


def server(port: int = 0) -> socket.socket:
    one = socket.create_server((HOST, port))
    one.settimeout(PATIENCE_S)
    return one


def port_of(one: socket.socket) -> int:
    return int(one.getsockname()[1])


def address_at(one: socket.socket) -> Address:
    host, port = one.getsockname()
    return Address(host, port, 0)


def accepted(one: socket.socket, hub: Hub) -> socket.socket:
    """Let the hub connect, and give the server's end."""
    receive_until(hub, lambda _: bool(hub.contact_addresses()))
    connection, _ = one.accept()
    connection.settimeout(PATIENCE_S)
    return connection


class TestConnecting:
    def test_frames_cross_in_both_directions(self) -> None:
        with (
            server() as vehicle,
            opened(f"tcp://{HOST}:{port_of(vehicle)}") as hub,
            accepted(vehicle, hub) as connection,
        ):
            connection.sendall(FRAME[:5])
            hub.receive(0.0)
            connection.sendall(FRAME[5:])
            ((address, frame),) = receive_until(hub, bool)
            assert frame == FRAME
            hub.send(address, FRAME)
            assert connection.recv(1000) == FRAME

    @pytest.mark.thorough
    def test_a_server_may_start_late_and_stop_and_restart(
        self, caplog: pytest.LogCaptureFixture
    ) -> None:
        with server() as placeholder:
            port = port_of(placeholder)
        with opened(f"tcp://{HOST}:{port}") as hub:
            for _ in range(30):
                hub.receive(0.02)
            assert len([r for r in caplog.records if r.levelno >= logging.WARNING]) == 1
            for _ in range(2):
                with server(port) as vehicle, accepted(vehicle, hub) as connection:
                    connection.sendall(FRAME)
                    assert [data for _, data in receive_until(hub, bool)] == [FRAME]
                receive_until(hub, lambda _: not hub.contact_addresses())

    def test_the_pauses_grow_until_a_frame_is_received(self) -> None:
        now = [100.0]
        with server() as placeholder:
            url = LinkUrl.parse(f"tcp://{HOST}:{port_of(placeholder)}")
        hub = open_links([url], lambda: now[0])
        (link,) = hub._links
        pauses = []
        for _ in range(8):
            hub.receive(0.0)
            while link.readers() or link.writers():
                hub.receive(0.1)
            due = link.due_at()
            assert due is not None
            pauses.append(due - now[0])
            now[0] = due
        hub.close()
        assert pauses == sorted(pauses)
        assert pauses[0] == pytest.approx(0.5)
        assert pauses[-1] == pytest.approx(5.0)

    def test_a_host_is_looked_up_by_name(self) -> None:
        with server() as vehicle, opened(f"tcp://localhost:{port_of(vehicle)}") as hub:
            accepted(vehicle, hub).close()

    def test_an_unknown_host_name_delays_nothing(self) -> None:
        with opened("tcp://no-such-host.invalid:5760") as hub:
            for _ in range(5):
                hub.receive(0.0)
            assert hub.contact_addresses() == []

    def test_a_server_that_reads_nothing_costs_old_frames_and_no_time(self) -> None:
        large = Encoder(1, 1).encode(mavlink.MAVLink_encapsulated_data_message(1, [7] * 253))
        with (
            server() as vehicle,
            opened(f"tcp://{HOST}:{port_of(vehicle)}") as hub,
            accepted(vehicle, hub),
        ):
            (address,) = hub.contact_addresses()
            for _ in range(100_000):
                hub.send(address, large)
                if hub.dropped > 100:
                    break
            assert hub.dropped > 100


class TestBeingConnectedTo:
    def test_several_clients_have_their_own_addresses(self) -> None:
        with opened(f"tcpin://{HOST}:0") as hub:
            place = (HOST, hub.urls[0].port)
            with socket.create_connection(place) as one, socket.create_connection(place) as two:
                receive_until(hub, lambda _: len(hub.contact_addresses()) == 2)
                one.sendall(FRAME)
                ((address, frame),) = receive_until(hub, bool)
                assert (address, frame) == (address_at(one), FRAME)
                hub.send(address, FRAME)
                one.settimeout(PATIENCE_S)
                assert one.recv(1000) == FRAME
                two.settimeout(0.0)
                with pytest.raises(BlockingIOError):
                    two.recv(1)
            receive_until(hub, lambda _: not hub.contact_addresses())
            hub.send(address, b"he is gone")

    def test_too_many_clients_are_refused(self) -> None:
        with opened(f"tcpin://{HOST}:0") as hub:
            place = (HOST, hub.urls[0].port)
            clients = [socket.create_connection(place) for _ in range(MAX_CLIENTS)]
            receive_until(hub, lambda _: len(hub.contact_addresses()) == MAX_CLIENTS)
            with socket.create_connection(place) as late:
                late.settimeout(0.01)
                receive_until(hub, lambda _: _is_closed(late))
            assert len(hub.contact_addresses()) == MAX_CLIENTS
            for client in clients:
                client.close()

    def test_a_busy_port_is_reported(self) -> None:
        with server() as other, pytest.raises(PortBusyError, match=f"TCP port {port_of(other)}"):
            open_links([LinkUrl.parse(f"tcpin://{HOST}:{port_of(other)}")])


def _is_closed(one: socket.socket) -> bool:
    try:
        return one.recv(1) == b""
    except TimeoutError:
        return False
    except ConnectionError:
        return True


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
