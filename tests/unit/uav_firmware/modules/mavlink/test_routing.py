"""Several clients at once, and a router that hears the vehicle at two of its ports."""

from typing import Any

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import (
    BROKER,
    GROUND,
    STRANGER,
    SYSTEM,
    Bench,
    command_long,
)
from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.wire.dialect import mavlink, parse

SECOND_US = 1_000_000
ARM, REQUEST = 400, 512
HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


def frames(bench: Bench) -> list[tuple[bytes, Address]]:
    """What has been sent since the last call, with where it went."""
    sent, bench.memory.sent = bench.memory.sent, []
    return sent


def messages(bench: Bench, seconds: float) -> int:
    """How many messages are sent in a stretch of time."""
    frames(bench)
    bench.run(round(seconds * SECOND_US))
    return sum(len(parse(datagram).messages) for datagram, _ in frames(bench))


def test_own_frames_that_come_back_by_a_router_are_not_answered() -> None:
    bench = Bench()
    bench.run(5 * SECOND_US)
    usual = messages(bench, 5.0)
    for _ in range(25):
        echoes = [
            (datagram, source) for datagram, _ in frames(bench) for source in (GROUND, BROKER)
        ]
        bench.memory.incoming += echoes
        bench.run(SECOND_US // 5)
    assert messages(bench, 5.0) == pytest.approx(usual, rel=0.02)


def test_an_own_heartbeat_from_a_strange_port_makes_no_peer() -> None:
    bench = Bench()
    bench.run(3 * SECOND_US)
    own = [(datagram, STRANGER) for datagram, to in frames(bench) if to == GROUND]
    bench.memory.incoming += own
    bench.run(3 * SECOND_US)
    assert bench.hear(at=STRANGER) == []


@pytest.mark.parametrize("component", [100, 191])
def test_a_computer_on_board_with_the_vehicles_system_id_is_served(component: int) -> None:
    bench = Bench()
    answers = bench.ask(
        command_long(REQUEST, 148), "AUTOPILOT_VERSION", system=SYSTEM, component=component
    )
    assert len(answers) == (component == 191), "100 is the vehicle's own camera"


def test_a_command_that_a_router_brings_by_two_ports_is_executed_once() -> None:
    bench = Bench()
    for source in (GROUND, BROKER):
        bench.say(command_long(ARM, 1.0), source=source, sequence=9)
    bench.run()
    (command,) = bench.commands()
    bench.answer(command, 0)
    bench.run()
    bench.say(command_long(ARM, 1.0), source=BROKER, sequence=9)
    bench.run()
    assert bench.commands() == []


def sequence_numbers(bench: Bench, to: Address) -> list[tuple[int, int]]:
    """Component and sequence number of each frame to a peer."""
    return [
        (message.get_srcComponent(), message.get_seq())
        for datagram, address in frames(bench)
        if address == to
        for message in parse(datagram).messages
    ]


def test_each_link_counts_its_own_frames_for_each_component() -> None:
    bench = Bench()
    bench.run(20 * SECOND_US)
    sent = list(bench.memory.sent)
    for peer in (GROUND, BROKER):
        bench.memory.sent = list(sent)
        numbers = sequence_numbers(bench, peer)
        for component in {component for component, _ in numbers}:
            own = [number for speaker, number in numbers if speaker == component]
            assert own == [(own[0] + i) % 256 for i in range(len(own))]


def test_clients_at_once_get_their_own_answers_and_the_common_telemetry() -> None:
    bench = Bench()
    bench.say(HEARTBEAT, source=STRANGER, system=200)
    bench.run(SECOND_US)
    frames(bench)
    bench.say(command_long(REQUEST, 148), source=STRANGER, system=200)
    bench.run(SECOND_US)

    def heard(at: Address) -> set[str]:
        return {message.get_type() for message in bench.hear(at=at)}

    stranger, ground, broker = heard(STRANGER), heard(GROUND), heard(BROKER)
    assert "AUTOPILOT_VERSION" in stranger
    assert not {"AUTOPILOT_VERSION", "COMMAND_ACK"} & (ground | broker)
    assert {"HEARTBEAT", "ATTITUDE"} <= stranger & ground & broker


def test_the_deprecated_request_for_streams_is_taken_without_effect() -> None:
    def rates(bench: Bench) -> tuple[int, int]:
        heard = [message.get_type() for message in bench.hear()]
        return heard.count("ATTITUDE"), heard.count("COMMAND_ACK")

    bench = Bench()
    bench.run(SECOND_US)
    bench.hear()
    bench.say(mavlink.MAVLink_request_data_stream_message(SYSTEM, 1, 0, 4, 1))
    bench.run(10 * SECOND_US)
    attitudes, acks = rates(bench)
    assert attitudes == pytest.approx(150, abs=2)
    assert acks == 0


def test_a_heartbeat_without_a_type_that_commands_keeps_no_link_alive() -> None:
    bench = Bench()
    camera: Any = mavlink.MAVLink_heartbeat_message(30, 8, 0, 0, 4, 3)
    bench.say(camera, source=GROUND, system=9, component=100)
    bench.run()
    assert bench.topics.ground_station_heartbeat.value is None
