"""Several clients at once, and a router connected at two ports."""

from typing import Any

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import (
    BROKER,
    GROUND,
    SYSTEM,
    UNKNOWN_PEER,
    MavlinkHarness,
    command_long,
)
from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.wire.dialect import mavlink, parse

SECOND_US = 1_000_000
ARM, REQUEST = 400, 512
HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


def frames(harness: MavlinkHarness) -> list[tuple[bytes, Address]]:
    """Messages sent since the last call, with their addresses."""
    sent, harness.memory.sent = harness.memory.sent, []
    return sent


def messages(harness: MavlinkHarness, seconds: float) -> int:
    """Number of messages sent in a period."""
    frames(harness)
    harness.run(round(seconds * SECOND_US))
    return sum(len(parse(datagram).messages) for datagram, _ in frames(harness))


def test_own_frames_returned_by_a_router_are_not_answered() -> None:
    harness = MavlinkHarness()
    harness.run(5 * SECOND_US)
    usual = messages(harness, 5.0)
    for _ in range(25):
        echoes = [
            (datagram, source) for datagram, _ in frames(harness) for source in (GROUND, BROKER)
        ]
        harness.memory.incoming += echoes
        harness.run(SECOND_US // 5)
    assert messages(harness, 5.0) == pytest.approx(usual, rel=0.02)


def test_own_heartbeats_open_no_channel() -> None:
    harness = MavlinkHarness()
    harness.run(3 * SECOND_US)
    own = [(datagram, UNKNOWN_PEER) for datagram, to in frames(harness) if to == GROUND]
    harness.memory.incoming += own
    harness.run(3 * SECOND_US)
    assert harness.received(at=UNKNOWN_PEER) == []


@pytest.mark.parametrize("component", [100, 191])
def test_a_companion_computer_with_the_vehicles_system_id_is_served(component: int) -> None:
    harness = MavlinkHarness()
    answers = harness.request(
        command_long(REQUEST, 148), "AUTOPILOT_VERSION", system=SYSTEM, component=component
    )
    assert len(answers) == (component == 191), "100 is the vehicle's own camera"


def test_a_command_routed_over_two_ports_is_executed_once() -> None:
    harness = MavlinkHarness()
    for source in (GROUND, BROKER):
        harness.send(command_long(ARM, 1.0), source=source, sequence=9)
    harness.run()
    (command,) = harness.commands()
    harness.answer(command, 0)
    harness.run()
    harness.send(command_long(ARM, 1.0), source=BROKER, sequence=9)
    harness.run()
    assert harness.commands() == []


def sequence_numbers(harness: MavlinkHarness, to: Address) -> list[tuple[int, int]]:
    """Component and sequence number of each frame to a peer."""
    return [
        (message.get_srcComponent(), message.get_seq())
        for datagram, address in frames(harness)
        if address == to
        for message in parse(datagram).messages
    ]


def test_each_link_counts_its_own_frames_for_each_component() -> None:
    harness = MavlinkHarness()
    harness.run(20 * SECOND_US)
    sent = list(harness.memory.sent)
    for peer in (GROUND, BROKER):
        harness.memory.sent = list(sent)
        numbers = sequence_numbers(harness, peer)
        for component in {component for component, _ in numbers}:
            own = [number for speaker, number in numbers if speaker == component]
            assert own == [(own[0] + i) % 256 for i in range(len(own))]


def test_simultaneous_clients_get_their_own_answers() -> None:
    harness = MavlinkHarness()
    harness.send(HEARTBEAT, source=UNKNOWN_PEER, system=200)
    harness.run(SECOND_US)
    frames(harness)
    harness.send(command_long(REQUEST, 148), source=UNKNOWN_PEER, system=200)
    harness.run(SECOND_US)

    def received(at: Address) -> set[str]:
        return {message.get_type() for message in harness.received(at=at)}

    unknown, ground, broker = received(UNKNOWN_PEER), received(GROUND), received(BROKER)
    assert "AUTOPILOT_VERSION" in unknown
    assert not {"AUTOPILOT_VERSION", "COMMAND_ACK"} & (ground | broker)
    assert {"HEARTBEAT", "ATTITUDE"} <= unknown & ground & broker


def test_request_data_stream_has_no_effect() -> None:
    def rates(harness: MavlinkHarness) -> tuple[int, int]:
        received = [message.get_type() for message in harness.received()]
        return received.count("ATTITUDE"), received.count("COMMAND_ACK")

    harness = MavlinkHarness()
    harness.run(SECOND_US)
    harness.received()
    harness.send(mavlink.MAVLink_request_data_stream_message(SYSTEM, 1, 0, 4, 1))
    harness.run(10 * SECOND_US)
    attitudes, acks = rates(harness)
    assert attitudes == pytest.approx(150, abs=2)
    assert acks == 0


@pytest.mark.parametrize(("system", "count"), [(SYSTEM, 1), (SYSTEM + 1, 0)])
def test_an_origin_that_is_set_is_refused_by_a_text(system: int, count: int) -> None:
    harness = MavlinkHarness()
    harness.send(mavlink.MAVLink_set_gps_global_origin_message(system, 404434000, -37382000, 0))
    harness.run()
    first = [m.text for m in harness.received("STATUSTEXT") if m.chunk_seq == 0]
    assert len(first) == count
    assert all(text.startswith("SET_GPS_GLOBAL_ORIGIN is not supported") for text in first)


def test_a_heartbeat_of_another_type_is_not_published() -> None:
    harness = MavlinkHarness()
    camera: Any = mavlink.MAVLink_heartbeat_message(30, 8, 0, 0, 4, 3)
    harness.send(camera, source=GROUND, system=9, component=100)
    harness.run()
    assert harness.topics.ground_station_heartbeat.value is None
