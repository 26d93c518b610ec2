"""Messages about link and vehicle: PING, TIMESYNC, versions, capabilities, modes.

PING and TIMESYNC use vehicle time. SYSTEM_TIME of a ground station is ignored, because the vehicle
has its own clock, and a simulation runs at its own speed.
"""

from typing import Final

from uav_firmware.modules.mavlink.commands.modes import (
    MODES,
    OFFERED,
    PROPERTY_AUTO_MODE,
)
from uav_firmware.modules.mavlink.telemetry.context import UINT32_MAX, Context
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import ProtocolVersion

_PING_US: Final = 1_000_000
MODE_TURN_US: Final = 3_333_333
"""Period of the stream of AVAILABLE_MODES, at 0.3 Hz; each message has the next mode."""
_VERSION_2: Final = 200
_VERSION_1: Final = 100
CAPABILITIES: Final[int] = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    | mavlink.MAV_PROTOCOL_CAPABILITY_FTP
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
    | mavlink.MAV_PROTOCOL_CAPABILITY_FLIGHT_TERMINATION
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMPONENT_IMPLEMENTS_GIMBAL_MANAGER
)
"""Capabilities of this vehicle."""
FLIGHT_SW_VERSION: Final = 1 << 24 | 16 << 16 | 0 << 8 | mavlink.FIRMWARE_VERSION_TYPE_DEV
"""1.16.0 of type DEV, by which ground stations choose PX4's parameter metadata."""
_AUTO: Final[int] = mavlink.MAV_MODE_FLAG_AUTO_ENABLED
VENDOR_ID: Final = 0x1209
"""pid.codes, the shared vendor id of open hardware."""
PRODUCT_ID: Final = 0x0001


def ping(context: Context) -> Message:
    """PING as a request to all systems; the sequence number is the time in seconds."""
    return mavlink.MAVLink_ping_message(
        time_usec=context.now_us,
        seq=context.now_us // _PING_US & UINT32_MAX,
        target_system=0,
        target_component=0,
    )


def timesync(context: Context) -> Message:
    """TIMESYNC as a request, with own time [ns]."""
    return mavlink.MAVLink_timesync_message(tc1=0, ts1=context.now_us * 1000)


def protocol_version(_context: Context) -> Message:
    """PROTOCOL_VERSION: version 2 is sent, 1 and 2 are read; no hashes."""
    return ProtocolVersion(
        version=_VERSION_2,
        min_version=_VERSION_1,
        max_version=_VERSION_2,
        spec_version_hash=[0] * 8,
        library_version_hash=[0] * 8,
    )


def available_modes_in_turn(context: Context) -> Message:
    """AVAILABLE_MODES of one mode after the other; REQUEST_MESSAGE returns all at once."""
    turn = context.now_us // MODE_TURN_US % len(OFFERED)
    return available_modes(turn + 1)[0]


def autopilot_version(system_id: int) -> Message:
    """AUTOPILOT_VERSION; `uid` is the system id, which distinguishes the vehicles of a farm."""
    uid = system_id.to_bytes(8, "little")
    return mavlink.MAVLink_autopilot_version_message(
        capabilities=CAPABILITIES,
        flight_sw_version=FLIGHT_SW_VERSION,
        middleware_sw_version=FLIGHT_SW_VERSION,
        os_sw_version=0,
        board_version=0,
        flight_custom_version=[0] * 8,
        middleware_custom_version=[0] * 8,
        os_custom_version=[0] * 8,
        vendor_id=VENDOR_ID,
        product_id=PRODUCT_ID,
        uid=system_id,
        uid2=list(uid + bytes(10)),
    )


def available_modes(index: int) -> list[Message]:
    """AVAILABLE_MODES of one index, from 1, or of all (0); empty for an unknown index."""
    indices = range(1, len(OFFERED) + 1) if index == 0 else (index,)
    return [_available_mode(i) for i in indices if 1 <= i <= len(OFFERED)]


def _available_mode(index: int) -> Message:
    mode = MODES[OFFERED[index - 1]]
    return mavlink.MAVLink_available_modes_message(
        number_modes=len(OFFERED),
        mode_index=index,
        standard_mode=mode.standard,
        custom_mode=mode.custom_mode,
        properties=PROPERTY_AUTO_MODE if mode.base_flags & _AUTO else 0,
        mode_name=mode.name.encode(),
    )


def answer_timesync(message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
    """Answer a request (tc1 is 0) with own time [ns]; an answer needs no answer."""
    if message.tc1 != 0:
        return []
    answer = mavlink.MAVLink_timesync_message(tc1=now_us * 1000, ts1=message.ts1)
    return [Outgoing(answer, sender.address)]


def answer_ping(message: Message, sender: Sender, _now_us: int) -> list[Outgoing]:
    """Answer a request (target 0/0) with its own content; a PING with a target is an answer."""
    if (message.target_system, message.target_component) != (0, 0):
        return []
    answer = mavlink.MAVLink_ping_message(
        time_usec=message.time_usec,
        seq=message.seq,
        target_system=sender.system,
        target_component=sender.component,
    )
    return [Outgoing(answer, sender.address)]
