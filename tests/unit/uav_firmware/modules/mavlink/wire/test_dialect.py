from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.modules.mavlink.wire.dialect import frame, mavlink, pack, parse

HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 12, 81, 0x04040000, 4, 3)
WAYPOINT = mavlink.MAVLink_mission_item_int_message(
    7, 1, 3, 6, 16, 0, 1, 0.0, 2.0, 0.0, 90.0, 404_434_000, -37_382_000, 12.5, 0
)


def framed(message: object, sequence: int = 0) -> bytes:
    return frame(pack(message), sequence, 255, 190)


@given(st.integers(0, 255), st.integers(1, 255), st.integers(1, 255))
def test_frames_equal_those_of_pymavlink(sequence: int, system: int, component: int) -> None:
    codec = mavlink.MAVLink(None, system, component)
    codec.seq = sequence
    for message in (HEARTBEAT, WAYPOINT):
        assert frame(pack(message), sequence, system, component) == message.pack(codec)


def example_of(message_class: Any) -> Any:
    """Build a message whose fields all differ."""
    lengths = dict(zip(message_class.ordered_fieldnames, message_class.array_lengths, strict=True))
    values: list[object] = []
    for number, (name, kind) in enumerate(
        zip(message_class.fieldnames, message_class.fieldtypes, strict=True), start=1
    ):
        if kind == "char":
            values.append(b"x" * lengths[name])
        else:
            values.append([number + i for i in range(lengths[name])] if lengths[name] else number)
    return message_class(*values)


def test_every_message_of_the_dialect_is_packed_as_pymavlink_packs_it() -> None:
    for message_class in mavlink.mavlink_map.values():
        message = example_of(message_class)
        whole = message.pack(mavlink.MAVLink(None, 7, 1))
        assert frame(pack(message), 0, 7, 1) == whole, message.get_type()


def test_a_datagram_may_hold_several_frames() -> None:
    parsed = parse(framed(HEARTBEAT, 1) + framed(WAYPOINT, 2))
    assert [m.get_type() for m in parsed.messages] == ["HEARTBEAT", "MISSION_ITEM_INT"]
    assert parsed.faults == 0


def test_a_version_1_frame_is_read() -> None:
    datagram = HEARTBEAT.pack(mavlink.MAVLink(None, 255, 190), force_mavlink1=True)
    (message,) = parse(datagram).messages
    assert (message.get_type(), message.get_srcSystem()) == ("HEARTBEAT", 255)


@given(st.binary(max_size=60))
def test_garbage_before_a_frame_is_skipped(garbage: bytes) -> None:
    # Without the two markers garbage cannot look like a frame
    clean = bytes(b for b in garbage if b not in {0xFD, 0xFE})
    parsed = parse(clean + framed(HEARTBEAT))
    assert [m.get_type() for m in parsed.messages] == ["HEARTBEAT"]


@given(st.integers(min_value=1), st.integers(0, 7))
def test_any_flipped_bit_invalidates_a_frame(position: int, bit: int) -> None:
    datagram = bytearray(framed(WAYPOINT))
    datagram[position % len(datagram)] ^= 1 << bit
    assert parse(bytes(datagram)).messages == []


@given(st.data())
def test_a_truncated_frame_is_ignored(data: st.DataObject) -> None:
    datagram = framed(WAYPOINT)
    length = data.draw(st.integers(0, len(datagram) - 1))
    assert parse(datagram[:length]).messages == []


def test_no_state_is_carried_over_to_the_next_datagram() -> None:
    datagram = framed(WAYPOINT)
    assert parse(datagram[:20]).messages == []
    assert parse(datagram[20:]).messages == []
    assert len(parse(datagram).messages) == 1


def test_a_frame_of_an_unknown_message_is_skipped() -> None:
    inner = framed(HEARTBEAT)
    outer = bytes([0xFD, len(inner), 0, 0, 0, 9, 1, 0x20, 0x4E, 0]) + inner + b"\x00\x00"
    parsed = parse(outer + framed(WAYPOINT))
    assert [m.get_type() for m in parsed.messages] == ["MISSION_ITEM_INT"]


def test_a_frame_with_an_unknown_incompatibility_is_dropped() -> None:
    datagram = bytearray(framed(HEARTBEAT))
    datagram[2] = 0x02
    assert parse(bytes(datagram)).messages == []


def test_a_signed_frame_is_read() -> None:
    codec = mavlink.MAVLink(None, 255, 190)
    codec.signing.secret_key = bytes(32)
    codec.signing.sign_outgoing = True
    (message,) = parse(HEARTBEAT.pack(codec)).messages
    assert message.get_type() == "HEARTBEAT"


@given(st.binary(max_size=4096))
def test_any_bytes_are_survived_with_bounded_faults(datagram: bytes) -> None:
    assert parse(datagram).faults <= 16


def test_a_flood_of_frame_beginnings_is_bounded() -> None:
    assert parse((b"\xfd" + bytes(11)) * 300).faults == 16
