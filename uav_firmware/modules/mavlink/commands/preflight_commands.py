"""PREFLIGHT_STORAGE and PREFLIGHT_REBOOT_SHUTDOWN; both require a disarmed vehicle."""

import math
from collections.abc import Callable, Iterator
from enum import IntEnum
from typing import Final

from uav_firmware.bus import Queue, Topic
from uav_firmware.modules.mavlink.commands.commands import (
    Answer,
    Command,
    PendingAnswer,
    denied,
    temporarily_rejected,
)
from uav_firmware.modules.mavlink.wire.addressing import Sender
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.status import (
    ParameterSaveRequest,
    ParameterSaveResult,
    VehicleCommandAck,
    VehicleStatus,
)
from uav_firmware.parameters import Registry

_READ: Final = 0.0
_WRITE: Final = 1.0
_RESETS: Final = frozenset({2.0, 4.0})
"""PARAM_RESET_CONFIG_DEFAULT and PARAM_RESET_ALL_DEFAULT, which are the same here."""
_PLANS_UNCHANGED: Final = frozenset({-1.0, 0.0, 1.0})

_ACCEPTED: Final = Answer(mavlink.MAV_RESULT_ACCEPTED)
_UNSUPPORTED: Final = Answer(mavlink.MAV_RESULT_UNSUPPORTED)


class StorageCommands:
    """Executes PREFLIGHT_STORAGE.

    Parameters and plans are stored as they change, so only a reset has an effect. The module that
    stores parameters saves them on request; its result is the answer.
    """

    def __init__(
        self,
        registry: Registry,
        *,
        vehicle_status: Topic[VehicleStatus],
        save_request: Queue[ParameterSaveRequest],
        request_ids: Iterator[int],
    ) -> None:
        """`request_ids` are also the tokens of the pending commands."""
        self._registry = registry
        self._vehicle_status = vehicle_status
        self._save_request = save_request
        self._request_ids = request_ids

    def answer(
        self, command: Command, _sender: Sender, _now_us: int
    ) -> Answer | PendingAnswer | None:
        """Execute PREFLIGHT_STORAGE; None for any other command."""
        if command.number != mavlink.MAV_CMD_PREFLIGHT_STORAGE:
            return None
        action, plans = command.parameter(1), command.parameter(2)
        if not (math.isnan(plans) or plans in _PLANS_UNCHANGED):
            return denied(f"parameter 2 is {plans:g}: plans are stored as they change")
        if action not in {_READ, _WRITE} | _RESETS:
            return denied(f"parameter 1 is {action:g}, no action")
        busy = _obstacle(self._vehicle_status.value)
        if busy is not None:
            return busy
        if action in _RESETS:
            self._registry.reset()
        if action == _READ:
            return _ACCEPTED
        request_id = next(self._request_ids)
        self._save_request.publish(ParameterSaveRequest(request_id))
        return PendingAnswer(request_id)


def _obstacle(status: VehicleStatus | None) -> Answer | None:
    """Refuse a command that requires a disarmed vehicle."""
    if status is None:
        return temporarily_rejected("it is not known whether the vehicle is armed")
    return temporarily_rejected("the vehicle is armed") if status.armed else None


def storage_ack(result: ParameterSaveResult, now_us: int) -> VehicleCommandAck:
    """The answer to the PREFLIGHT_STORAGE that requested a save."""
    return VehicleCommandAck(
        now_us,
        mavlink.MAV_CMD_PREFLIGHT_STORAGE,
        mavlink.MAV_RESULT_FAILED if result.fault else mavlink.MAV_RESULT_ACCEPTED,
        progress=0,
        token=result.request_id,
    )


class PowerAction(IntEnum):
    """Values of parameter 1 of PREFLIGHT_REBOOT_SHUTDOWN."""

    NONE = 0
    REBOOT = 1
    SHUTDOWN = 2


class PowerCommands:
    """Executes PREFLIGHT_REBOOT_SHUTDOWN.

    Autopilot, companion computer, camera and gimbal are one process, so parameters 2 to 4 may only
    request the same action or none.
    """

    def __init__(
        self,
        request: Callable[[PowerAction], None] | None,
        vehicle_status: Topic[VehicleStatus],
    ) -> None:
        """`request` is called with an accepted action; without it they are unsupported."""
        self._request = request
        self._vehicle_status = vehicle_status

    def answer(self, command: Command, _sender: Sender, _now_us: int) -> Answer | None:
        """Execute PREFLIGHT_REBOOT_SHUTDOWN; None for any other command."""
        if command.number != mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN:
            return None
        if not _is_possible(command):
            return denied("parameters 1 to 4 are no restart or shutdown of the whole vehicle")
        busy = _obstacle(self._vehicle_status.value)
        if busy is not None:
            return busy
        action = PowerAction(int(command.parameter(1)))
        if action is not PowerAction.NONE:
            if self._request is None:
                return _UNSUPPORTED
            self._request(action)
        return _ACCEPTED


def _is_possible(command: Command) -> bool:
    """Whether all components have the same action; there is no boot loader to stop in."""
    autopilot, *others = command.parameters[:4]
    alike = all(math.isnan(other) or other in {0.0, autopilot} for other in others)
    return autopilot in set(PowerAction) and alike
