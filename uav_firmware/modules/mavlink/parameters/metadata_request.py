"""COMPONENT_METADATA: where the description of this component lies."""

import math
from collections.abc import Callable
from typing import Final

from uav_firmware.modules.mavlink.commands.commands import Command
from uav_firmware.modules.mavlink.files.metadata_files import GENERAL, address_of
from uav_firmware.modules.mavlink.telemetry.requests import Answer
from uav_firmware.modules.mavlink.wire.addressing import Sender
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import ComponentMetadata

_TARGETS: Final = {0.0: False, 1.0: False, 2.0: True}  # To all peers?


class MetadataRequest:
    """Answers REQUEST_MESSAGE for COMPONENT_METADATA."""

    def __init__(self, general_checksum: Callable[[], int]) -> None:
        """Take what gives the checksum of the general file."""
        self._general_checksum = general_checksum

    def answer(self, command: Command, _sender: Sender, now_us: int) -> Answer | None:
        """Answer the request; None when the command is another."""
        is_request = command.number == mavlink.MAV_CMD_REQUEST_MESSAGE
        if not is_request or command.parameter(1) != ComponentMetadata.id:
            return None
        target = command.parameter(7)
        to_all = _TARGETS.get(0.0 if math.isnan(target) else target)
        if to_all is None:
            return Answer(mavlink.MAV_RESULT_DENIED)
        message = ComponentMetadata(
            time_boot_ms=now_us // 1000 & 0xFFFFFFFF,
            file_crc=self._general_checksum(),
            uri=address_of(GENERAL).encode("ascii"),
        )
        return Answer(mavlink.MAV_RESULT_ACCEPTED, (message,), to_all)
