"""PREFLIGHT_STORAGE: parameters written to the medium, or put back to their defaults."""

import math
from collections.abc import Callable
from typing import Final

from uav_firmware.bus import Topic
from uav_firmware.modules.mavlink.commands.commands import Command
from uav_firmware.modules.mavlink.telemetry.requests import Answer
from uav_firmware.modules.mavlink.wire.addressing import Sender
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.status import VehicleStatus
from uav_firmware.parameters import Registry

_READ: Final = 0.0
_WRITE: Final = 1.0
_RESETS: Final = frozenset({2.0, 4.0})
"""PARAM_RESET_CONFIG_DEFAULT and PARAM_RESET_ALL_DEFAULT: there is nothing else than parameters."""
_PLANS_LEFT_ALONE: Final = frozenset({-1.0, 0.0, 1.0})

_ACCEPTED: Final = Answer(mavlink.MAV_RESULT_ACCEPTED)
_BUSY: Final = Answer(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
_DENIED: Final = Answer(mavlink.MAV_RESULT_DENIED)
_FAILED: Final = Answer(mavlink.MAV_RESULT_FAILED)


class StorageCommands:
    """Answers PREFLIGHT_STORAGE of a vehicle that is disarmed.

    Parameters and plans are stored as they change, so that reading and writing find the work
    done; only a reset changes something.
    """

    def __init__(
        self,
        registry: Registry,
        save: Callable[[], None],
        vehicle_status: Topic[VehicleStatus],
    ) -> None:
        """Take the parameters, and `save`, which may raise OSError."""
        self._registry = registry
        self._save = save
        self._vehicle_status = vehicle_status

    def answer(self, command: Command, _sender: Sender, _now_us: int) -> Answer | None:
        """Carry PREFLIGHT_STORAGE out; None for any other command."""
        if command.number != mavlink.MAV_CMD_PREFLIGHT_STORAGE:
            return None
        action, plans = command.parameter(1), command.parameter(2)
        if not (math.isnan(plans) or plans in _PLANS_LEFT_ALONE):
            return _DENIED
        if action not in {_READ, _WRITE} | _RESETS:
            return _DENIED
        status = self._vehicle_status.value
        if status is None or status.armed:
            return _BUSY
        if action in _RESETS:
            self._registry.reset()
        return _ACCEPTED if action == _READ else self._saved()

    def _saved(self) -> Answer:
        try:
            self._save()
        except OSError:
            return _FAILED
        return _ACCEPTED
