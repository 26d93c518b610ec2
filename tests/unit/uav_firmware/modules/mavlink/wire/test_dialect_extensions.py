import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.modules.mavlink.wire.dialect import frame, mavlink, pack, parse
from uav_firmware.modules.mavlink.wire.dialect_extensions import (
    CommandCancel,
    MissionAck,
    MissionCount,
    MissionCurrent,
    ParamValue,
    raw_param_value,
)

UINT32 = st.integers(0, 0xFFFFFFFF)


def travelled(message: object) -> object:
    (arrived,) = parse(frame(pack(message), 0, 1, 1)).messages
    return arrived


@given(UINT32)
def test_mission_ack_has_the_opaque_id(identifier: int) -> None:
    sent = MissionAck(target_system=255, target_component=190, type=0, opaque_id=identifier)
    arrived = travelled(sent)
    assert arrived.opaque_id == identifier  # type: ignore[attr-defined]  # a message
    assert arrived.target_component == 190  # type: ignore[attr-defined]  # as above


@given(UINT32, UINT32, UINT32)
def test_mission_current_has_three_plan_ids(mission: int, fence: int, rally: int) -> None:
    sent = MissionCurrent(seq=3, total=9, mission_id=mission, fence_id=fence, rally_points_id=rally)
    arrived = travelled(sent)
    names = ("seq", "total", "mission_id", "fence_id", "rally_points_id")
    assert [getattr(arrived, name) for name in names] == [3, 9, mission, fence, rally]


def test_layouts_match_the_message_definitions() -> None:
    assert struct.Struct("<BBBBI").size == MissionAck.unpacker.size
    assert struct.Struct("<HBBBI").size == MissionCount.unpacker.size
    assert struct.Struct("<HHBBIII").size == MissionCurrent.unpacker.size
    assert (MissionAck.crc_extra, MissionCount.crc_extra, MissionCurrent.crc_extra) == (
        153,
        221,
        28,
    )
    count = MissionCount(target_system=2, target_component=3, count=0x0405, opaque_id=0x06070809)
    assert pack(count).body == bytes([5, 4, 2, 3, 0, 9, 8, 7, 6])


def test_a_peer_with_the_shipped_dialect_reads_the_acknowledgement() -> None:
    shipped = mavlink.MAVLink_mission_ack_message
    body = pack(MissionAck(target_system=255, target_component=190, type=5, opaque_id=9)).body
    assert shipped.unpacker.unpack(body[: shipped.unpacker.size]) == (255, 190, 5, 0)


def test_command_cancel_is_decoded() -> None:
    arrived = travelled(CommandCancel(target_system=7, target_component=1, command=22))
    names = ("target_system", "target_component", "command")
    assert [getattr(arrived, name) for name in names] == [7, 1, 22]


def test_a_field_that_does_not_exist_is_refused() -> None:
    with pytest.raises(TypeError, match="opaque"):
        MissionAck(opaque=1)


@given(st.integers(-0x80000000, 0x7FFFFFFF))
def test_every_integer_is_preserved_in_the_float_field(value: int) -> None:
    raw = struct.pack("<i", value)
    body = pack(
        ParamValue(param_id=b"X", param_value=raw, param_type=6, param_count=1, param_index=0)
    ).body
    assert body[:4] == raw


def test_signalling_nan_bits_are_preserved() -> None:
    raw = struct.pack("<i", -5_000_000)
    quiet = mavlink.MAVLink_param_set_message(7, 1, b"X", math.pi, 6)
    body = raw + pack(quiet).body[4:]
    (arrived,) = parse(frame(pack(quiet)._replace(body=body), 0, 255, 190)).messages
    assert raw_param_value(arrived) == raw
