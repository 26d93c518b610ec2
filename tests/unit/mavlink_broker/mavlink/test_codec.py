"""Copies of frames with another signature have the same contents, and pymavlink accepts them."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.mavlink.codec import (
    Decoder,
    Encoder,
    checksum_holds,
    frame_size,
    is_signed,
    message_id,
    sender,
    sequence,
    signed,
    unsigned,
    with_sequence,
)
from mavlink_broker.mavlink.dialect import mavlink

KEY = bytes(range(32))
TICKS = 123_456_789
MESSAGES = [
    mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3),
    mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0),
    mavlink.MAVLink_statustext_message(6, b"hello", 7, 1),
    mavlink.MAVLink_ping_message(2**63, 7, 1, 1),
]


def frame_of(message: Any, *, version_1: bool = False) -> bytes:
    codec = mavlink.MAVLink(None, 7, 9)
    codec.seq = 200
    return bytes(message.pack(codec, force_mavlink1=version_1))


def unknown_frame() -> bytes:
    """A message that no dialect has, with its own CRC_EXTRA."""
    body = bytes((3, 0, 0, 5, 7, 9)) + (77_777).to_bytes(3, "little") + b"abc"
    checksum: int = mavlink.x25crc(body + b"\x55").crc
    return b"\xfd" + body + checksum.to_bytes(2, "little")


def with_its_key(frame: bytes) -> Any:
    codec = mavlink.MAVLink(None)
    codec.signing.secret_key = KEY
    return codec.decode(bytearray(frame))


@pytest.mark.parametrize("version_1", [False, True])
@pytest.mark.parametrize("message", MESSAGES)
def test_a_signed_copy_is_accepted_and_has_the_same_contents(
    message: Any, *, version_1: bool
) -> None:
    original = Decoder().decode(frame_of(message, version_1=version_1))[0]
    frame = signed(frame_of(message, version_1=version_1), KEY, 3, TICKS)
    decoded = with_its_key(frame)
    assert decoded.to_dict() == original.to_dict()
    assert (decoded.get_srcSystem(), decoded.get_srcComponent(), decoded.get_seq()) == (7, 9, 200)
    assert frame[-13] == 3
    assert int.from_bytes(frame[-12:-6], "little") == TICKS


@pytest.mark.parametrize("message", MESSAGES)
def test_an_unsigned_copy_is_the_frame_before_it_was_signed(message: Any) -> None:
    plain = frame_of(message)
    assert unsigned(signed(plain, KEY, 0, TICKS)) == plain
    assert unsigned(plain) == plain


@pytest.mark.parametrize("version_1", [False, True])
@given(number=st.integers(0, 255))
def test_another_sequence_number_changes_nothing_else(number: int, *, version_1: bool) -> None:
    changed = with_sequence(frame_of(MESSAGES[0], version_1=version_1), number)
    assert checksum_holds(changed)
    assert sequence(changed) == number
    assert with_sequence(changed, 200) == frame_of(MESSAGES[0], version_1=version_1)


def test_a_message_that_the_dialect_lacks_keeps_a_right_checksum() -> None:
    plain = unknown_frame()
    assert checksum_holds(plain) is None
    assert message_id(plain) == 77_777
    again = with_sequence(plain, 6)
    assert mavlink.x25crc(again[1:-2] + b"\x55").crc == int.from_bytes(again[-2:], "little")
    assert unsigned(signed(plain, KEY, 0, TICKS)) == plain


def test_the_header_is_read_in_both_versions() -> None:
    for version_1 in (False, True):
        frame = frame_of(MESSAGES[1], version_1=version_1)
        assert (message_id(frame), sender(frame), sequence(frame)) == (76, (7, 9), 200)
        assert frame_size(frame, 0) == len(frame)
        assert not is_signed(frame)


def test_a_damaged_frame_does_not_hold() -> None:
    for place in range(1, 20):
        frame = bytearray(Encoder(1, 1).encode(MESSAGES[1]))
        frame[place] ^= 0x10
        assert checksum_holds(bytes(frame)) is not True
