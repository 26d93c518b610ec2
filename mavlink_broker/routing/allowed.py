"""What ground stations may always send: messages that read, none that changes a flight.

Everything else, including messages without a definition, is refused while a mission of the broker
runs.
"""

from typing import Final

from mavlink_broker.mavlink.dialect import mavlink

MESSAGES: Final = frozenset(
    {
        "PING",
        "TIMESYNC",
        "PARAM_REQUEST_READ",
        "PARAM_REQUEST_LIST",
        "PARAM_EXT_REQUEST_READ",
        "PARAM_EXT_REQUEST_LIST",
        "LOG_REQUEST_LIST",
        "LOG_REQUEST_DATA",
        "LOG_REQUEST_END",
        "REQUEST_EVENT",
        "GPS_RTCM_DATA",  # Corrections: a receiver that loses them loses its fix
        "OPEN_DRONE_ID_BASIC_ID",  # Remote identification is required by law
        "OPEN_DRONE_ID_OPERATOR_ID",
        "OPEN_DRONE_ID_SELF_ID",
        "OPEN_DRONE_ID_SYSTEM",
        "OPEN_DRONE_ID_SYSTEM_UPDATE",
    }
)

MISSION_READS: Final = frozenset(
    {"MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"}
)
"""Allowed except during a mission transfer of the broker."""

MISSION_WRITES: Final = frozenset(
    {
        "MISSION_COUNT",
        "MISSION_ITEM",
        "MISSION_ITEM_INT",
        "MISSION_WRITE_PARTIAL_LIST",
        "MISSION_CLEAR_ALL",
        "MISSION_SET_CURRENT",
    }
)

COMMANDS: Final = frozenset(
    {
        mavlink.MAV_CMD_GET_HOME_POSITION,
        mavlink.MAV_CMD_GET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_REQUEST_MESSAGE,
        mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION,
        mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
        mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION,
        mavlink.MAV_CMD_REQUEST_CAMERA_SETTINGS,
        mavlink.MAV_CMD_REQUEST_STORAGE_INFORMATION,
        mavlink.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS,
        mavlink.MAV_CMD_REQUEST_FLIGHT_INFORMATION,
        mavlink.MAV_CMD_REQUEST_CAMERA_IMAGE_CAPTURE,
        mavlink.MAV_CMD_VIDEO_START_STREAMING,  # Live video; recording is another command
        mavlink.MAV_CMD_VIDEO_STOP_STREAMING,
        mavlink.MAV_CMD_REQUEST_VIDEO_STREAM_INFORMATION,
        mavlink.MAV_CMD_REQUEST_VIDEO_STREAM_STATUS,
    }
)
"""In addition to SET_MESSAGE_INTERVAL, which `policy` decides."""

FILE_READS: Final = frozenset({0, 1, 2, 3, 4, 5, 14, 15, 16})
"""Opcodes of MAVLink FTP that only read: none, terminate, reset, list, open to read, read,
checksum, burst read, list with time."""

NEVER: Final = frozenset({"SETUP_SIGNING", "AUTH_KEY"})
"""Never forwarded: signing keys are set over trusted links only, not through the broker."""
