"""Decoding of any bytes to messages, and which senders are autopilots that may fly a mission."""

import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import (
    AUTOPILOT,
    NOT_VEHICLES,
    RESULT_NAMES,
    Message,
    MissionAck,
    MissionCount,
    MissionCurrent,
    is_order,
    is_vehicle,
    mavlink,
    replaces_autopilot,
    source_of,
)


def heartbeat() -> Any:
    return mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)


@pytest.mark.parametrize(
    ("message", "field", "value"),
    [
        (MissionAck(254, 191, 0, 0, 0xDEADBEEF), "opaque_id", 0xDEADBEEF),
        (MissionCount(254, 191, 12, 0, 0xDEADBEEF), "opaque_id", 0xDEADBEEF),
        (MissionCurrent(3, 12, 3, 1, 0xDEADBEEF, 5, 6), "mission_id", 0xDEADBEEF),
    ],
)
def test_ids_of_plans_survive_the_wire(message: Any, field: str, value: int) -> None:
    (decoded,) = Decoder().decode(Encoder(1, 1).encode(message))
    assert getattr(decoded, field) == value
    assert decoded.to_dict() == message.to_dict()


@pytest.mark.parametrize(
    ("sent", "field"),
    [
        (mavlink.MAVLink_mission_ack_message(254, 191, 0, 0), "opaque_id"),
        (mavlink.MAVLink_mission_count_message(254, 191, 3, 0), "opaque_id"),
        (mavlink.MAVLink_mission_current_message(3, 12, 3, 1), "mission_id"),
    ],
)
def test_a_sender_without_ids_is_read_as_giving_none(sent: Any, field: str) -> None:
    (decoded,) = Decoder().decode(Encoder(1, 1).encode(sent))
    assert getattr(decoded, field) == 0


def test_the_sender_is_known() -> None:
    (message,) = Decoder().decode(Encoder(7, 100).encode(heartbeat()))
    assert source_of(message) == (7, 100)


def test_everything_is_sent_as_version_2_with_a_counter_of_its_own() -> None:
    one, other = Encoder(254, 191), Encoder(254, 191)
    frames = [one.encode(heartbeat()) for _ in range(300)]
    assert {frame[0] for frame in frames} == {0xFD}
    assert [frame[4] for frame in frames] == [i % 256 for i in range(300)]
    assert other.encode(heartbeat())[4] == 0


def test_version_1_is_read_too() -> None:
    frame = heartbeat().pack(mavlink.MAVLink(None, 1, 1), force_mavlink1=True)
    assert frame[0] == 0xFE
    assert len(Decoder().decode(frame)) == 1


def test_several_frames_of_one_datagram_are_all_read() -> None:
    encoder = Encoder(1, 1)
    datagram = b"".join(encoder.encode(heartbeat()) for _ in range(3))
    assert len(Decoder().decode(datagram)) == 3


@given(st.binary(max_size=600))
def test_any_bytes_are_survived(data: bytes) -> None:
    Decoder().decode(data)


@given(st.binary(max_size=60), st.binary(max_size=60))
def test_a_good_frame_is_found_between_rubbish(before: bytes, after: bytes) -> None:
    frame = Encoder(1, 1).encode(heartbeat())
    rubbish = before.replace(b"\xfd", b"").replace(b"\xfe", b"")
    messages = Decoder().decode(rubbish + frame + after)
    assert messages[0].get_type() == "HEARTBEAT"


@given(st.integers(1, 20))
def test_a_damaged_frame_is_not_read(position: int) -> None:
    frame = bytearray(Encoder(1, 1).encode(heartbeat()))
    frame[position] ^= 0x55
    assert all(m.get_type() != "HEARTBEAT" for m in Decoder().decode(bytes(frame)))


def test_a_broken_datagram_does_not_spoil_the_next() -> None:
    decoder = Decoder()
    frame = Encoder(1, 1).encode(heartbeat())
    assert decoder.decode(frame[:-3]) == []
    assert len(decoder.decode(frame)) == 1
    assert decoder.faults > 0


def test_unset_fields_do_not_fit_the_wire() -> None:
    message = mavlink.MAVLink_mission_request_int_message(1, 1, 70_000)
    with pytest.raises(struct.error):
        Encoder(1, 1).encode(message)


def test_every_result_has_a_name() -> None:
    assert all(RESULT_NAMES[number].startswith("MAV_RESULT") for number in range(11))


@pytest.mark.parametrize("data", [b"\xfd" * 4096, b"\xfe\x00" * 2048, b"\xfd\xff\x00" * 1365])
def test_a_datagram_full_of_start_bytes_is_abandoned_early(data: bytes) -> None:
    decoder = Decoder()
    assert decoder.decode(data) == []
    assert decoder.faults == 16


def test_a_fault_in_one_datagram_costs_nothing_of_the_next() -> None:
    decoder, encoder = Decoder(), Encoder(1, 1)
    for _ in range(50):
        decoder.decode(b"\xfd" * 4096)
    assert len(decoder.decode(encoder.encode(heartbeat()))) == 1


@pytest.mark.parametrize("fields", [{"mission_type": 1}, {"nonsense": 5}])
def test_a_field_that_has_no_name_there_is_refused(fields: dict[str, int]) -> None:
    with pytest.raises(TypeError, match="MissionAck"):
        MissionAck(1, 1, 0, **fields)
    with pytest.raises(TypeError, match="MissionAck"):
        MissionAck(1, 1, 0, 0, 7, 8)


def heartbeat_of(component: int, *, kind: int = mavlink.MAV_TYPE_QUADROTOR) -> Message:
    message = mavlink.MAVLink_heartbeat_message(kind, mavlink.MAV_AUTOPILOT_GENERIC, 0, 0, 4, 3)
    message.pack(mavlink.MAVLink(None, 7, component))
    return message


@pytest.mark.parametrize("kind", sorted(NOT_VEHICLES))
def test_what_does_not_fly_is_no_vehicle(kind: int) -> None:
    message = mavlink.MAVLink_heartbeat_message(kind, mavlink.MAV_AUTOPILOT_PX4, 0, 0, 4, 3)
    assert not is_vehicle(message)


@pytest.mark.parametrize(
    ("component", "is_autopilot"),
    [
        (AUTOPILOT, True),
        (mavlink.MAV_COMP_ID_USER1, True),
        (mavlink.MAV_COMP_ID_ONBOARD_COMPUTER, False),
        (mavlink.MAV_COMP_ID_CAMERA, False),
    ],
)
def test_a_part_that_reports_a_generic_autopilot_is_no_vehicle(
    component: int, *, is_autopilot: bool
) -> None:
    assert is_vehicle(heartbeat_of(component)) is is_autopilot


def test_the_standard_component_replaces_another_autopilot_and_no_other_does() -> None:
    assert replaces_autopilot(AUTOPILOT, 25)
    assert replaces_autopilot(25, None)
    assert not replaces_autopilot(25, AUTOPILOT)
    assert not replaces_autopilot(AUTOPILOT, AUTOPILOT)


@pytest.mark.parametrize(
    ("message", "is_one"),
    [
        (mavlink.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF), False),
        (mavlink.MAVLink_log_request_data_message(1, 1, 3, 0, 90), False),
        (mavlink.MAVLink_log_request_end_message(1, 1), False),
        (mavlink.MAVLink_log_erase_message(1, 1), True),
        (MissionAck(1, 1, 0), False),
        (MissionCount(1, 1, 3), True),
    ],
)
def test_what_reads_or_ends_a_transfer_is_no_order(message: Any, *, is_one: bool) -> None:
    assert is_order(message) is is_one
