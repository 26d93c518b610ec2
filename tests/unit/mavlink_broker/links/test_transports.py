"""TCP links connect, reconnect and accept; UDP links answer the sender; serial lines are raw."""

import logging
import random
import socket
import termios
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from mavlink_broker.links.hub import Hub, open_links
from mavlink_broker.links.link import QUEUE_BYTES, FrameScanner, LinkError, PortBusyError
from mavlink_broker.links.transports import MAX_CLIENTS
from mavlink_broker.links.url import Address, LinkUrl
from mavlink_broker.mavlink.codec import Encoder
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.descriptors import many_open_files
from tests.support.link_ends import PATIENCE_S, Cable, receive_until

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


def dropped(hub: Hub) -> int:
    return sum(link.dropped for link in hub._links)


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
                if dropped(hub) > 100:
                    break
            assert dropped(hub) > 100


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


HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)


@pytest.fixture
def cable(tmp_path: Path) -> Iterator[Cable]:
    with closing(Cable(tmp_path / "ttyRADIO")) as made:
        yield made


@pytest.fixture
def hub(cable: Cable) -> Iterator[Hub]:
    opened = open_links([LinkUrl.parse(f"serial://{cable.name}:57600")])
    yield opened
    opened.close()


def address_of(cable: Cable) -> Address:
    return Address(str(cable.name), 57600, 0)


def frames(count: int, system: int = 1) -> list[bytes]:
    encoder = Encoder(system, 1)
    return [encoder.encode(HEARTBEAT) for _ in range(count)]


def open_line(hub: Hub) -> None:
    receive_until(hub, lambda _: bool(hub.contact_addresses()))


def test_frames_cross_in_both_directions(cable: Cable, hub: Hub) -> None:
    cable.plug_in()
    open_line(hub)
    sent = frames(3)
    cable.write(sent[0] + sent[1][:7])
    arrivals = receive_until(hub, lambda received: len(received) == 1)
    cable.write(sent[1][7:] + sent[2])
    arrivals += receive_until(hub, lambda received: len(received) == 2)
    assert arrivals == [(address_of(cable), frame) for frame in sent]
    hub.send(address_of(cable), sent[0])
    assert cable.read() == sent[0]


def test_the_line_is_raw_and_has_the_configured_speed(cable: Cable, hub: Hub) -> None:
    cable.plug_in()
    open_line(hub)
    modes = cable.modes()
    assert modes[4:6] == [termios.B57600] * 2
    every_byte = bytes(range(256))
    hub.send(address_of(cable), every_byte)
    assert cable.read() == every_byte


@pytest.mark.thorough
def test_a_device_may_appear_late_and_disappear_and_return(cable: Cable, hub: Hub) -> None:
    hub.receive(0.0)
    hub.send(address_of(cable), b"not received")
    for _ in range(3):
        cable.plug_in()
        open_line(hub)
        cable.write(frames(1)[0])
        assert receive_until(hub, bool) == [(address_of(cable), frames(1)[0])]
        cable.pull_out()
        receive_until(hub, lambda _: not hub.contact_addresses())


def test_a_blocked_line_never_blocks_the_hub_and_loses_whole_frames(cable: Cable, hub: Hub) -> None:
    cable.plug_in()
    open_line(hub)
    encoder = Encoder(1, 1)
    sent = [encoder.encode(HEARTBEAT) for _ in range(5000)]
    for frame in sent:
        hub.send(address_of(cable), frame)
    assert dropped(hub) > 1000
    received = b""
    while data := cable.read(512):
        received += data
        hub.receive(0.0)
    whole = {frame: number for number, frame in enumerate(sent[-256:])}
    arrived = [received[at : at + len(sent[0])] for at in range(0, len(received), len(sent[0]))]
    assert all(frame in whole for frame in arrived)
    assert len(arrived) == len(sent) - dropped(hub)
    assert arrived[-1] == sent[-1]
    assert len(arrived) * len(sent[0]) >= QUEUE_BYTES - len(sent[0])


def test_a_hostile_stream_stops_nothing(cable: Cable, hub: Hub) -> None:
    cable.plug_in()
    open_line(hub)
    chance = random.Random(7)
    sent = frames(20, system=9)
    received = []
    for frame in sent:
        for noise in (b"\x00" * 3000, chance.randbytes(3000), b"\xfe" * 900, b"\xfd" * 900):
            cable.write(noise)
            received += hub.receive(0.0)
        cable.write(frame)
        received += hub.receive(0.0)
    received += receive_until(
        hub, lambda more: sent[-1] in {data for _, data in [*received, *more]}
    )
    assert [data for _, data in received if data in sent] == sent


def test_a_line_that_another_program_uses_is_retried(
    cable: Cable, hub: Hub, caplog: pytest.LogCaptureFixture
) -> None:
    cable.plug_in()
    other = open_links([LinkUrl.parse(f"serial://{cable.name}:57600")])
    open_line(other)
    hub.receive(0.0)
    assert hub.contact_addresses() == []
    assert "another program uses it" in caplog.text
    other.close()
    open_line(hub)


def test_an_error_in_one_link_costs_neither_the_others_nor_what_it_receives_later(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    feed = FrameScanner.feed

    def fail(scanner: FrameScanner, data: bytes, now: float) -> list[bytes]:
        if data == b"unforeseen":
            raise IndexError("index out of range")
        return feed(scanner, data, now)

    monkeypatch.setattr(FrameScanner, "feed", fail)
    with opened(f"tcpin://{HOST}:0") as hub:
        hub.add(LinkUrl.parse(f"tcpin://{HOST}:0"))
        places = [(HOST, url.port) for url in hub.urls]
        with (
            socket.create_connection(places[0]) as one,
            socket.create_connection(places[1]) as other,
        ):
            receive_until(hub, lambda _: len(hub.contact_addresses()) == 2)
            one.sendall(b"unforeseen")
            receive_until(hub, lambda _: "index out of range" in caplog.text)
            for end in (other, one):
                end.sendall(FRAME)
                assert receive_until(hub, bool)[0][1] == FRAME


def test_a_file_instead_of_a_device_is_retried(tmp_path: Path) -> None:
    path = tmp_path / "ttyFILE"
    path.write_text("no terminal")
    hub = open_links([LinkUrl.parse(f"serial://{path}:57600")])
    hub.receive(0.0)
    assert hub.contact_addresses() == []
    hub.close()


def test_an_unsupported_speed_is_refused() -> None:
    with pytest.raises(LinkError, match="12345 is not"):
        open_links([LinkUrl.parse("serial:///dev/ttyUSB0:12345")])


@pytest.mark.thorough
def test_a_full_radio_is_written_to_slowly(cable: Cable, hub: Hub) -> None:
    cable.plug_in()
    open_line(hub)
    for _ in range(20):
        hub.radio_status(address_of(cable), 0)
    sent = frames(60)
    for frame in sent:
        hub.send(address_of(cable), frame)
    received = cable.read()
    assert len(received) < len(sent) * len(sent[0]) / 2
    while len(received) < len(sent) * len(sent[0]):
        hub.receive(0.02)
        received += cable.read()
    assert received == b"".join(sent)
