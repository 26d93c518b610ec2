"""A serial line, by a pseudo-terminal: silent, full, noisy, unplugged and plugged in again."""

import random
import termios
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from mavlink_broker.links.hub import Hub, open_links
from mavlink_broker.links.link import QUEUE_BYTES, LinkError
from mavlink_broker.links.url import Address, LinkUrl
from mavlink_broker.mavlink.codec import Encoder
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.link_ends import Cable, receive_until

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
    assert hub.dropped > 1000
    received = b""
    while data := cable.read(512):
        received += data
        hub.receive(0.0)
    whole = {frame: number for number, frame in enumerate(sent[-256:])}
    arrived = [received[at : at + len(sent[0])] for at in range(0, len(received), len(sent[0]))]
    assert all(frame in whole for frame in arrived)
    assert len(arrived) == len(sent) - hub.dropped
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
