"""PREFLIGHT_REBOOT_SHUTDOWN: the vehicle's process begins anew, or ends."""

import math
from collections.abc import Callable
from enum import IntEnum
from typing import Final

from uav_firmware.bus import Topic
from uav_firmware.modules.mavlink.commands.commands import Command
from uav_firmware.modules.mavlink.telemetry.requests import Answer
from uav_firmware.modules.mavlink.wire.addressing import Sender
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.status import VehicleStatus


class PowerAction(IntEnum):
    """What is asked for: the values of MAVLink's parameter 1."""

    NONE = 0
    REBOOT = 1
    SHUTDOWN = 2


_ACCEPTED: Final = Answer(mavlink.MAV_RESULT_ACCEPTED)
_BUSY: Final = Answer(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
_DENIED: Final = Answer(mavlink.MAV_RESULT_DENIED)
_UNSUPPORTED: Final = Answer(mavlink.MAV_RESULT_UNSUPPORTED)


class PowerCommands:
    """Answers PREFLIGHT_REBOOT_SHUTDOWN of a vehicle that is disarmed.

    Autopilot, computer on board, camera and gimbal are one process: parameters 2 to 4 may ask
    for the same of the others, and for nothing else.
    """

    def __init__(
        self,
        request: Callable[[PowerAction], None] | None,
        vehicle_status: Topic[VehicleStatus],
    ) -> None:
        """Take what is called with a wish that is granted; None where nobody can grant one."""
        self._request = request
        self._vehicle_status = vehicle_status

    def answer(self, command: Command, _sender: Sender, _now_us: int) -> Answer | None:
        """Grant or refuse PREFLIGHT_REBOOT_SHUTDOWN; None for any other command."""
        if command.number != mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN:
            return None
        if not _is_possible(command):
            return _DENIED
        status = self._vehicle_status.value
        if status is None or status.armed:
            return _BUSY
        action = PowerAction(int(command.parameter(1)))
        if action is not PowerAction.NONE:
            if self._request is None:
                return _UNSUPPORTED
            self._request(action)
        return _ACCEPTED


def _is_possible(command: Command) -> bool:
    """Whether all parts are to do the same; there is no boot loader to stop in."""
    autopilot, *others = command.parameters[:4]
    alike = all(math.isnan(other) or other in {0.0, autopilot} for other in others)
    return autopilot in set(PowerAction) and alike
