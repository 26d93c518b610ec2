"""Forwarded frames between vehicles and ground stations: source, sequence number, answers."""

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.autopilots.status_texts import StatusTexts
from mavlink_broker.mavlink.codec import Decoder, Encoder, encoded_as, sequence, signed, unsigned
from mavlink_broker.mavlink.dialect import Source, mavlink
from mavlink_broker.routing import gateway
from mavlink_broker.routing.gateway import (
    CHUNK_BYTES,
    GCS_TIMEOUT_S,
    KINDS_KEPT,
    ForwardedFrames,
    Gateway,
)
from mavlink_broker.routing.policy import BrokerControl

OWN, GROUND = 254, Source(255, 190)
HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
LAND = mavlink.MAV_CMD_NAV_LAND
NOW = 0.0


def decoded(frame: bytes) -> Any:
    (message,) = Decoder(keeps_unknown=True).decode(frame)
    return message


class GatewayWorld:
    """A gateway, its vehicles and a ground station."""

    def __init__(self, *, may_command: bool = False, vehicles: tuple[int, ...] = (1, 2)) -> None:
        self.controls = dict.fromkeys(vehicles, BrokerControl.FREE)
        self.gateway = Gateway(OWN, self.controls.__getitem__, may_command=may_command)
        self.ground = Encoder(*GROUND)
        self.autopilot = Encoder(1, 1)

    def send(self, message: Any, now: float = 0.0) -> ForwardedFrames:
        message = decoded(self.ground.encode(message))
        return self.gateway.from_ground_station(message, self.controls.keys(), now)

    def forward(self, message: Any, now: float = NOW) -> bytes | None:
        return self.gateway.from_vehicle(decoded(self.autopilot.encode(message)), now)


def command(number: int, system: int = 1) -> Any:
    return mavlink.MAVLink_command_long_message(system, 1, number, 0, *[0.0] * 7)


def acknowledgement(system: int, component: int) -> Any:
    return mavlink.MAVLink_command_ack_message(400, 0, 0, 0, system, component)


def test_a_message_is_forwarded_unchanged_to_its_target() -> None:
    world = GatewayWorld()
    ((target, frame),) = world.send(command(LAND, system=2)).to_vehicles
    assert target == Source(2, 1)
    assert decoded(frame).get_srcSystem() == 255
    assert frame == encoded_as(command(LAND, system=2), GROUND, 0)


def test_a_broadcast_is_forwarded_to_free_vehicles_and_refused_for_others() -> None:
    world = GatewayWorld(vehicles=(1, 2, 3))
    world.controls[2] = BrokerControl.MISSION
    result = world.send(command(LAND, system=0))
    assert [target.system for target, _ in result.to_vehicles] == [1, 3]
    assert {decoded(frame).get_srcSystem() for frame in result.to_ground_stations} == {2}


def test_a_message_to_an_unknown_vehicle_is_dropped() -> None:
    assert GatewayWorld().send(command(LAND, system=9)) == ForwardedFrames()


def test_a_refusal_is_answered_as_the_vehicle_explained_once_and_counted() -> None:
    world = GatewayWorld()
    world.controls[1] = BrokerControl.MISSION
    first = [decoded(frame) for frame in world.send(command(LAND)).to_ground_stations]
    assert [(m.get_type(), m.get_srcSystem(), m.get_srcComponent()) for m in first] == [
        ("COMMAND_ACK", 1, 1),
        ("STATUSTEXT", 1, 1),
    ]
    assert "broker" in first[1].text
    again = [
        decoded(frame).get_type() for frame in world.send(command(LAND), 1.0).to_ground_stations
    ]
    assert again == ["COMMAND_ACK"]
    assert first[1].text.endswith("NAV_LAND")
    assert world.gateway.refusals.count == {"NAV_LAND": 2}


PREFIX = "Denied during a broker mission: "


@pytest.mark.parametrize("length", [1, 17, 18, 19, 67, 68, 69])
def test_a_refusal_is_explained_in_as_many_chunks_as_it_needs(
    monkeypatch: pytest.MonkeyPatch, length: int
) -> None:
    """As STATUSTEXT has it: a common id, numbers, and a last chunk that is not full."""
    name = "X" * length
    monkeypatch.setattr(gateway, "name_of", lambda _message: name)
    world = GatewayWorld()
    world.controls[1] = BrokerControl.MISSION
    _, *chunks = [decoded(frame) for frame in world.send(command(LAND)).to_ground_stations]
    assert "".join(chunk.text for chunk in chunks) == PREFIX + name
    assert [chunk.chunk_seq for chunk in chunks] == list(range(len(chunks)))
    assert len({chunk.id for chunk in chunks}) == 1
    is_whole = len(PREFIX + name) <= CHUNK_BYTES
    assert is_whole == (chunks[0].id == 0) == (len(chunks) == 1)
    if not is_whole:
        *full, last = [len(chunk.text) for chunk in chunks]
        assert full == [CHUNK_BYTES] * len(full)
        assert last < CHUNK_BYTES
    texts = StatusTexts()
    for chunk in reversed(chunks):
        texts.receive(chunk, 0.0)
    assert texts.since(0.0) == [PREFIX + name]


def test_texts_in_several_chunks_have_ids_of_their_own() -> None:
    world = GatewayWorld()
    world.controls[1] = BrokerControl.MISSION
    write = mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, [0, 0, 0, 7] + [0] * 247)
    long_command = command(mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION)
    sent = [world.send(message).to_ground_stations for message in (write, long_command)]
    texts = [[decoded(frame) for frame in frames[1:]] for frames in sent]
    assert ["".join(chunk.text for chunk in chunks) for chunks in texts] == [
        f"{PREFIX}FILE_TRANSFER_PROTOCOL",
        f"{PREFIX}NAV_FENCE_POLYGON_VERTEX_INCLUSION",
    ]
    assert [{chunk.id for chunk in chunks} for chunks in texts] == [{0xFFFF}, {0xFFFE}]


def test_with_forward_commands_every_command_is_forwarded() -> None:
    world = GatewayWorld(may_command=True)
    world.controls[1] = BrokerControl.MISSION
    assert len(world.send(command(LAND)).to_vehicles) == 1
    assert len(world.send(HEARTBEAT).to_vehicles) == 2


def test_a_heartbeat_shows_a_ground_station_and_is_not_forwarded() -> None:
    world = GatewayWorld()
    assert not world.gateway.has_ground_station(100.0)
    assert world.send(HEARTBEAT, 100.0) == ForwardedFrames()
    assert world.gateway.has_ground_station(100.0 + GCS_TIMEOUT_S)
    assert not world.gateway.has_ground_station(100.1 + GCS_TIMEOUT_S)


@pytest.mark.parametrize("system", [0, 1, 2, OWN])
def test_a_sender_with_the_id_of_a_vehicle_or_the_broker_is_ignored(system: int) -> None:
    world = GatewayWorld()
    message = decoded(encoded_as(command(LAND), Source(system, 1), 0))
    assert (
        world.gateway.from_ground_station(message, world.controls.keys(), 0.0) == ForwardedFrames()
    )
    assert not world.gateway.has_ground_station(0.0)


def test_a_vehicles_frames_are_forwarded_unchanged_except_for_their_signature() -> None:
    world = GatewayWorld()
    plain = Encoder(1, 1).encode(HEARTBEAT)
    assert world.gateway.from_vehicle(decoded(plain), NOW) == plain
    assert world.gateway.from_vehicle(decoded(signed(plain, bytes(32), 0, 7)), NOW) == unsigned(
        plain
    )


def test_messages_to_the_broker_are_not_forwarded() -> None:
    world = GatewayWorld()
    assert world.forward(acknowledgement(OWN, 191)) is None
    assert world.forward(acknowledgement(0, 0)) is not None
    assert world.forward(acknowledgement(*GROUND)) is not None


def test_data_of_a_log_is_forwarded_while_a_ground_station_reads_one() -> None:
    world = GatewayWorld()
    data = mavlink.MAVLink_log_data_message(3, 0, 90, [0] * 90)
    assert world.forward(data) is None
    assert world.forward(mavlink.MAVLink_log_entry_message(0, 1, 0, 0, 9)) is not None
    world.send(mavlink.MAVLink_log_request_data_message(1, 1, 3, 0, 10**6))
    assert world.forward(data) is not None
    world.send(mavlink.MAVLink_log_request_end_message(1, 1))
    assert world.forward(data) is None
    world.send(mavlink.MAVLink_log_request_data_message(1, 1, 3, 0, 10**6))
    assert world.forward(data, GCS_TIMEOUT_S + 1.0) is None  # It has gone


def test_an_answer_to_timesync_is_forwarded_if_a_ground_station_has_asked() -> None:
    """One that the broker asked for has the broker's clock: a ground station would set its own."""
    world = GatewayWorld()
    world.controls[1] = BrokerControl.MISSION
    answer = mavlink.MAVLink_timesync_message(777, 55)
    assert world.forward(answer) is None
    assert world.forward(mavlink.MAVLink_timesync_message(0, 66)) is not None  # Its own request
    sent = world.send(mavlink.MAVLink_timesync_message(0, 55))
    assert {decoded(frame).ts1 for _, frame in sent.to_vehicles} == {55}
    assert world.forward(answer) is not None
    assert world.forward(mavlink.MAVLink_timesync_message(777, 56)) is None


def test_withheld_and_inserted_frames_do_not_look_lost_and_lost_ones_do() -> None:
    world = GatewayWorld()
    world.controls[1] = BrokerControl.MISSION
    numbers = []
    for n in range(300):
        if n == 200:
            world.autopilot.encode(HEARTBEAT)  # Never arrives
        forwarded = world.forward(acknowledgement(OWN, 191) if n % 7 == 3 else HEARTBEAT)
        numbers += [sequence(forwarded)] if forwarded else []
        if n % 50 == 10:
            numbers += [sequence(f) for f in world.send(command(LAND), float(n)).to_ground_stations]
    gaps = [(b - a) % 256 for a, b in pairwise(numbers)]
    assert gaps.count(1) == len(gaps) - 1
    assert gaps.count(2) == 1


def test_endless_kinds_of_refused_messages_do_not_fill_memory() -> None:
    world = GatewayWorld()
    world.controls[1] = BrokerControl.MISSION
    for number in range(2 * KINDS_KEPT):
        world.send(command(40_000 + number))
    assert len(world.gateway.refusals.count) <= KINDS_KEPT + 1
    assert world.gateway.refusals.count.total() == 2 * KINDS_KEPT


def test_the_log_names_the_most_frequent_refusals_only(caplog: pytest.LogCaptureFixture) -> None:
    world = GatewayWorld()
    world.controls[1] = BrokerControl.MISSION
    for number in [LAND] * 3 + list(range(40_000, 40_050)):
        world.send(command(number))
    (first, second) = world.send(HEARTBEAT, 60.0), world.send(HEARTBEAT, 120.0)
    assert first == second == ForwardedFrames()
    (_, line) = [record.getMessage() for record in caplog.records]
    assert "2 NAV_LAND" in line
    assert "more kinds" in line
    assert len(line) < 300


@given(st.sampled_from(sorted(mavlink.mavlink_map)), st.binary(min_size=1, max_size=255))
def test_no_message_whatever_is_in_it_breaks_anything(number: int, payload: bytes) -> None:
    kind = mavlink.mavlink_map[number]
    payload = payload.ljust(kind.unpacker.size, b"\0")[: min(kind.unpacker.size, 255)]
    header = bytes((0xFD, len(payload), 0, 0, 0, 255, 190)) + number.to_bytes(3, "little")
    checksum = mavlink.x25crc(header[1:] + payload + bytes((kind.crc_extra,))).crc
    frame = header + payload + checksum.to_bytes(2, "little")
    world = GatewayWorld(vehicles=(1, 2, 3))
    world.controls |= {1: BrokerControl.MISSION, 2: BrokerControl.TRANSFER}
    for message in Decoder(keeps_unknown=True).decode(frame):
        result = world.gateway.from_ground_station(message, world.controls.keys(), 0.0)
        for answer in result.to_ground_stations:
            assert decoded(answer).get_srcSystem() in {1, 2, 3}
        for target, passed in result.to_vehicles:
            assert target.system in {1, 2, 3}
            assert decoded(passed).get_srcSystem() == 255
