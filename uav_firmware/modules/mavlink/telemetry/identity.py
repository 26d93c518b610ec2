"""What the vehicle is: AUTOPILOT_VERSION and the list of modes."""

from typing import Final

from uav_firmware.modules.mavlink.commands.modes import (
    MODES,
    OFFERED,
    PROPERTY_AUTO_MODE,
)
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink

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
"""Only what is true; a bit is added with the service that it promises."""

FLIGHT_SW_VERSION: Final = 1 << 24 | 16 << 16 | 0 << 8 | mavlink.FIRMWARE_VERSION_TYPE_DEV
"""1.16.0 of type DEV: ground stations choose PX4's parameter metadata by it."""

_AUTO: Final[int] = mavlink.MAV_MODE_FLAG_AUTO_ENABLED

VENDOR_ID: Final = 0x1209
"""pid.codes, the vendor id that open hardware shares."""
PRODUCT_ID: Final = 0x0001


def autopilot_version(system_id: int) -> Message:
    """AUTOPILOT_VERSION; `uid` is the system id, which tells vehicles of one farm apart."""
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
    """AVAILABLE_MODES of one index, from 1, or of all (0); empty for an index beyond the list."""
    wanted = range(1, len(OFFERED) + 1) if index == 0 else (index,)
    return [_available_mode(i) for i in wanted if 1 <= i <= len(OFFERED)]


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
