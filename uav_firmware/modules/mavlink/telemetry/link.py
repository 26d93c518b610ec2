"""About the link itself: clocks, round trips, protocol version, the modes in turn."""

from typing import Final

from uav_firmware.modules.mavlink.commands.modes import OFFERED
from uav_firmware.modules.mavlink.telemetry.context import Context
from uav_firmware.modules.mavlink.telemetry.conversion import UINT32_MAX
from uav_firmware.modules.mavlink.telemetry.identity import available_modes
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import ProtocolVersion

_PING_US: Final = 1_000_000
MODE_TURN_US: Final = 3_333_333
"""How long each mode has its turn in the stream of AVAILABLE_MODES: one message, at 0.3 Hz."""
_VERSION_2: Final = 200
_VERSION_1: Final = 100


def ping(context: Context) -> Message:
    """PING as a request to everybody; the number is the second of the vehicle's time."""
    return mavlink.MAVLink_ping_message(
        time_usec=context.now_us,
        seq=context.now_us // _PING_US & UINT32_MAX,
        target_system=0,
        target_component=0,
    )


def timesync(context: Context) -> Message:
    """TIMESYNC as a request: own time [ns] to be sent back beside the other's."""
    return mavlink.MAVLink_timesync_message(tc1=0, ts1=context.now_us * 1000)


def protocol_version(_context: Context) -> Message:
    """PROTOCOL_VERSION: version 2 is sent, 1 and 2 are understood; no hash of a specification."""
    return ProtocolVersion(
        version=_VERSION_2,
        min_version=_VERSION_1,
        max_version=_VERSION_2,
        spec_version_hash=[0] * 8,
        library_version_hash=[0] * 8,
    )


def available_modes_in_turn(context: Context) -> Message:
    """AVAILABLE_MODES of one mode after the other; REQUEST_MESSAGE gives all at once."""
    turn = context.now_us // MODE_TURN_US % len(OFFERED)
    return available_modes(turn + 1)[0]
