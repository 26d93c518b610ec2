"""Messages and values of MAVLink that the shipped dialect lacks.

Extension fields are at the end of a payload and do not change CRC_EXTRA, so a peer with the
shipped dialect reads these messages without the fields that it lacks. Definitions: MAVLink
common.xml and development.xml, messages 42, 44, 47, 80 and 300.
"""

import struct
from typing import Any, Final

from uav_firmware.modules.mavlink.wire.dialect import mavlink, register

MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME: Final = 9
MAV_PARAM_ERROR_TYPE_MISMATCH: Final = 7
MAV_CMD_DO_SET_STANDARD_MODE: Final = 262


def _extended(base: Any, names: list[str]) -> dict[str, Any]:
    """Class attributes of a message with uint32 extension fields appended."""
    count = len(names)
    layout = bytes(base.native_format).decode() + "I" * count
    return {
        "fieldnames": [*base.fieldnames, *names],
        "ordered_fieldnames": [*base.ordered_fieldnames, *names],
        "fieldtypes": [*base.fieldtypes, *["uint32_t"] * count],
        "native_format": bytearray(layout.encode()),
        "orders": [*base.orders, *range(len(base.orders), len(base.orders) + count)],
        "lengths": [*base.lengths, *[1] * count],
        "array_lengths": [*base.array_lengths, *[0] * count],
        "unpacker": struct.Struct(layout),
    }


class _Extended(mavlink.MAVLink_message):  # type: ignore[misc]  # pymavlink is untyped
    """A generated message with additional fields, build by name or in the order of `fieldnames`."""

    def __init__(self, *values: Any, **named: Any) -> None:
        super().__init__(self.id, self.msgname)
        self._fieldnames = self.fieldnames
        self._instance_field = None
        self._instance_offset = -1
        fields = dict.fromkeys(self.fieldnames, 0)
        fields.update(zip(self.fieldnames, values, strict=False))
        unknown = named.keys() - fields.keys()
        if unknown:
            raise TypeError(f"{self.msgname} has no field {', '.join(sorted(unknown))}")
        fields.update(named)
        for name, value in fields.items():
            setattr(self, name, value)

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:  # noqa: FBT001, FBT002 - pymavlink's signature
        """Pack as pymavlink's generated classes do."""
        values: list[Any] = []
        for name in self.ordered_fieldnames:
            value = getattr(self, name)
            values += value if isinstance(value, list) else [value]
        packed: bytes = self._pack(
            mav, self.crc_extra, self.unpacker.pack(*values), force_mavlink1=force_mavlink1
        )
        return packed


def _extend(base: Any, names: list[str]) -> Any:
    """Register a copy of `base` with `names` appended."""
    attributes = {
        "__doc__": f"{base.msgname} with {', '.join(names)}.",
        "id": base.id,
        "msgname": base.msgname,
        "crc_extra": base.crc_extra,
        **_extended(base, names),
    }
    return register(type(base.msgname, (_Extended,), attributes))


MissionAck: Final = _extend(mavlink.MAVLink_mission_ack_message, ["opaque_id"])
MissionCount: Final = _extend(mavlink.MAVLink_mission_count_message, ["opaque_id"])
MissionCurrent: Final = _extend(
    mavlink.MAVLink_mission_current_message, ["mission_id", "fence_id", "rally_points_id"]
)


class ParamValue(_Extended):
    """PARAM_VALUE(22) with the value as four raw bytes.

    The float field carries the bits of an integer parameter. A Python float changes bits that form
    a signalling NaN (those of -5,000,000 do).
    """

    id = 22
    msgname = "PARAM_VALUE"
    fieldnames: list[str] = mavlink.MAVLink_param_value_message.fieldnames
    ordered_fieldnames: list[str] = mavlink.MAVLink_param_value_message.ordered_fieldnames
    crc_extra: int = mavlink.MAVLink_param_value_message.crc_extra
    unpacker = struct.Struct("<4sHH16sB")


def raw_param_value(message: Any) -> bytes:
    """The four bytes of the value of a received PARAM_SET, which are first in its payload."""
    frame = message.get_msgbuf()
    start = (
        mavlink.HEADER_LEN_V2 if frame[0] == mavlink.PROTOCOL_MARKER_V2 else mavlink.HEADER_LEN_V1
    )
    length = frame[1]
    return bytes(frame[start : start + min(length, 4)]).ljust(4, b"\x00")


@register
class CommandCancel(_Extended):
    """COMMAND_CANCEL(80): cancels a long-running command."""

    id = 80
    msgname = "COMMAND_CANCEL"
    fieldnames: list[str] = ["target_system", "target_component", "command"]  # noqa: RUF012 - pymavlink's layout
    ordered_fieldnames: list[str] = ["command", "target_system", "target_component"]  # noqa: RUF012 - as above
    fieldtypes: list[str] = ["uint8_t", "uint8_t", "uint16_t"]  # noqa: RUF012 - as above
    native_format = bytearray(b"<HBB")
    orders: list[int] = [1, 2, 0]  # noqa: RUF012 - as above
    lengths: list[int] = [1, 1, 1]  # noqa: RUF012 - as above
    array_lengths: list[int] = [0, 0, 0]  # noqa: RUF012 - as above
    crc_extra = 14
    unpacker = struct.Struct("<HBB")


@register
class ComponentMetadata(_Extended):
    """COMPONENT_METADATA(397): URI of a component's general metadata file."""

    id = 397
    msgname = "COMPONENT_METADATA"
    fieldnames: list[str] = ["time_boot_ms", "file_crc", "uri"]  # noqa: RUF012 - pymavlink's layout
    ordered_fieldnames: list[str] = fieldnames
    fieldtypes: list[str] = ["uint32_t", "uint32_t", "char"]  # noqa: RUF012 - as above
    native_format = bytearray(b"<IIc")
    orders: list[int] = [0, 1, 2]  # noqa: RUF012 - as above
    lengths: list[int] = [1, 1, 1]  # noqa: RUF012 - as above
    array_lengths: list[int] = [0, 0, 100]  # noqa: RUF012 - as above
    crc_extra = 182
    unpacker = struct.Struct("<II100s")


@register
class ProtocolVersion(_Extended):
    """PROTOCOL_VERSION(300): supported versions of MAVLink, times 100."""

    id = 300
    msgname = "PROTOCOL_VERSION"
    fieldnames: list[str] = [  # noqa: RUF012 - pymavlink's layout
        "version",
        "min_version",
        "max_version",
        "spec_version_hash",
        "library_version_hash",
    ]
    ordered_fieldnames: list[str] = fieldnames
    fieldtypes: list[str] = [*["uint16_t"] * 3, *["uint8_t"] * 2]  # noqa: RUF012 - as above
    native_format = bytearray(b"<HHHBB")
    orders: list[int] = [0, 1, 2, 3, 4]  # noqa: RUF012 - as above
    lengths: list[int] = [1, 1, 1, 8, 8]  # noqa: RUF012 - as above
    array_lengths: list[int] = [0, 0, 0, 8, 8]  # noqa: RUF012 - as above
    crc_extra = 217
    unpacker = struct.Struct("<HHH8B8B")
