"""Hostile bytes: the module survives and executes no command."""

import math
from typing import Any, Final

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.mavlink.harness import (
    GROUND,
    STEP_US,
    SYSTEM,
    MavlinkHarness,
    command_long,
)
from uav_firmware.modules.mavlink.commands.commands import FORWARDED
from uav_firmware.modules.mavlink.dispatcher import Dispatcher
from uav_firmware.modules.mavlink.module import MAX_MESSAGES_PER_CALL
from uav_firmware.modules.mavlink.wire.dialect import Payload, frame, mavlink, pack

HANDLED: Final = {
    cls
    for cls in mavlink.mavlink_map.values()
    if cls.msgname
    in {
        "HEARTBEAT", "COMMAND_LONG", "COMMAND_INT", "COMMAND_CANCEL", "SET_MODE",
        "GIMBAL_MANAGER_SET_ATTITUDE", "GIMBAL_MANAGER_SET_PITCHYAW",
        "GIMBAL_MANAGER_SET_MANUAL_CONTROL",
        "MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ITEM", "MISSION_REQUEST_LIST",
        "MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_CLEAR_ALL", "MISSION_ACK",
        "MISSION_REQUEST_PARTIAL_LIST", "MISSION_WRITE_PARTIAL_LIST", "MISSION_SET_CURRENT",
        "PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET", "TIMESYNC", "PING",
        "SET_GPS_GLOBAL_ORIGIN",
        "SYSTEM_TIME", "REQUEST_DATA_STREAM", "MANUAL_CONTROL", "SET_ATTITUDE_TARGET",
        "SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT",
        "FOLLOW_TARGET", "FILE_TRANSFER_PROTOCOL", "LOG_REQUEST_LIST", "LOG_REQUEST_DATA",
        "LOG_REQUEST_END", "LOG_ERASE", "LOGGING_ACK", "SETUP_SIGNING",
    }
}  # fmt: skip
SPECIAL: Final = [math.nan, math.inf, -math.inf, 0.0, -0.0, 1e38, -1e38, 1e-45]


def send_payload(harness: MavlinkHarness, cls: Any, body: bytes) -> None:
    """Send a message with a valid checksum and any contents."""
    trimmed = body.rstrip(b"\x00") or b"\x00"
    datagram = frame(Payload(cls.id, cls.crc_extra, trimmed), 0, 255, 190)
    harness.memory.incoming.append((datagram, GROUND))


def test_the_list_of_handled_messages_is_complete() -> None:
    harness = MavlinkHarness()
    dispatcher = harness.module._dispatcher
    assert isinstance(dispatcher, Dispatcher)
    assert set(dispatcher._handlers) <= {cls.msgname for cls in HANDLED}


@given(st.lists(st.binary(max_size=600), max_size=10))
def test_random_bytes_command_nothing(datagrams: list[bytes]) -> None:
    harness = MavlinkHarness()
    harness.memory.incoming += [(datagram, GROUND) for datagram in datagrams]
    harness.run(20_000)
    assert harness.commands() == []


@pytest.mark.thorough
@given(st.sampled_from(sorted(HANDLED, key=lambda cls: cls.id)), st.data())
@settings(max_examples=400)
def test_any_contents_of_a_handled_message_are_survived(cls: Any, data: st.DataObject) -> None:
    harness = MavlinkHarness()
    size = cls.unpacker.size
    body = bytearray(data.draw(st.binary(min_size=size, max_size=size)))
    for name in ("target_system", "target_component"):
        if name in cls.ordered_fieldnames and data.draw(st.booleans()):
            index = cls.ordered_fieldnames.index(name)
            fields = list(cls.unpacker.unpack(bytes(body)))
            fields[index] = {"target_system": SYSTEM, "target_component": 1}[name]
            body = bytearray(cls.unpacker.pack(*fields))
    send_payload(harness, cls, bytes(body))
    harness.run(20_000)
    for command in harness.commands():
        assert command.command in FORWARDED


@pytest.mark.thorough
@given(
    st.sampled_from(sorted(FORWARDED)), st.lists(st.sampled_from(SPECIAL), min_size=7, max_size=7)
)
def test_special_numbers_in_commands_are_survived_and_answered(
    number: int, parameters: list[float]
) -> None:
    harness = MavlinkHarness()
    harness.send(command_long(number, *parameters))
    harness.run()
    harness.run(3_000_000)
    assert len(harness.received("COMMAND_ACK")) == 1


@given(st.data())
def test_a_command_with_any_bit_flipped_commands_nothing(data: st.DataObject) -> None:
    harness = MavlinkHarness()
    arm = frame(pack(command_long(400, 1.0)), 0, 255, 190)
    flipped = bytearray(arm)
    position = data.draw(st.integers(0, len(arm) - 1))
    flipped[position] ^= 1 << data.draw(st.integers(0, 7))
    harness.memory.incoming.append((bytes(flipped), GROUND))
    harness.run()
    assert harness.commands() == []


def test_the_work_of_a_flood_is_bounded() -> None:
    harness = MavlinkHarness()
    request = frame(pack(command_long(512, 148)), 0, 255, 190)
    harness.memory.incoming += [(request * 60, GROUND)] * 60
    harness.run(STEP_US)
    answered = len(harness.received("AUTOPILOT_VERSION"))
    assert answered == MAX_MESSAGES_PER_CALL == 128
    assert harness.module.refused.flood == 58
    assert harness.request(command_long(512, 148), "AUTOPILOT_VERSION")


def test_a_flood_of_malformed_frames_is_counted() -> None:
    harness = MavlinkHarness()
    harness.memory.incoming += [(b"\xfd" + bytes(11), GROUND)] * 100
    harness.run()
    assert harness.module.refused.malformed == 100
    assert harness.received("COMMAND_ACK") == []
