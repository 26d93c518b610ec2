"""Checks, executes and answers every order to the payload.

An order from a link is executed or refused at once. The mission's orders are executed in sequence:
each waits until its predecessor allows it, so that no order is lost and each picture is taken in
the direction that the mission commanded before it.
"""

from collections.abc import Mapping
from typing import Final

from uav_firmware.lib.payload_rules import fault_of
from uav_firmware.modules.payload import camera_orders, gimbal_orders
from uav_firmware.modules.payload.camera.states import CameraBusyError, CameraState
from uav_firmware.modules.payload.parts import Parts
from uav_firmware.modules.payload.situation import Outcome, Situation, denied, temporarily_rejected
from uav_firmware.msg.payload import PayloadCommand
from uav_firmware.msg.status import CommandResult, NavigationState, VehicleCommand

GIMBAL_TIMEOUT_US: Final = 5_000_000
"""[us] Longest time that a picture of the mission waits for the gimbal."""

_HANDLERS: Final[Mapping[int, camera_orders.Handler]] = {
    **camera_orders.HANDLERS,
    **gimbal_orders.HANDLERS,
}
_PICTURES: Final = frozenset(
    {
        PayloadCommand.IMAGE_START_CAPTURE,
        PayloadCommand.DO_DIGICAM_CONTROL,
        PayloadCommand.DO_SET_CAM_TRIGG_DIST,
    }
)
_ENDING_MODES: Final = frozenset(
    {
        NavigationState.AUTO_RTL,
        NavigationState.AUTO_LAND,
        NavigationState.AUTO_PRECLAND,
        NavigationState.TERMINATION,
    }
)


def execute(command: VehicleCommand, parts: Parts, situation: Situation) -> Outcome:
    """Execute a command or refuse it."""
    handler = _HANDLERS.get(command.command)
    if handler is None:
        return Outcome(CommandResult.UNSUPPORTED)
    name = PayloadCommand(command.command).name
    fault = fault_of(command.command, command[2:9])
    if fault is not None:
        return denied(f"{name} denied: parameter {fault.parameter} {fault.reason}")
    try:
        outcome = handler(command, parts, situation)
    except CameraBusyError as error:
        outcome = temporarily_rejected(str(error))
    if outcome.reason:
        return outcome._replace(reason=f"{name} refused: {outcome.reason}")
    return outcome


class MissionOrders:
    """Executes the pending orders of the mission."""

    def __init__(self) -> None:
        self._since_us: int | None = None  # When the first order started to wait for the gimbal

    def update(self, parts: Parts, situation: Situation) -> list[Outcome]:
        """Execute the orders that may start now; return the refusals."""
        refusals: list[Outcome] = []
        orders = parts.mission_orders
        while orders and self._may_start(orders[0], parts, situation.now_us):
            outcome = execute(orders[0], parts, situation)
            if outcome.result is CommandResult.TEMPORARILY_REJECTED:
                if parts.camera.ends_by_itself or parts.panorama is not None:
                    break
                if parts.camera.stop_series():
                    continue
            orders.popleft()
            self._since_us = None
            if outcome.result is not CommandResult.ACCEPTED:
                refusals.append(outcome)
        return refusals

    def _may_start(self, order: VehicleCommand, parts: Parts, now_us: int) -> bool:
        if order.command in gimbal_orders.HANDLERS:
            return parts.camera.state is not CameraState.SINGLE
        if order.command not in _PICTURES or parts.gimbal.settled:
            return True
        if self._since_us is None:
            self._since_us = now_us
        return now_us - self._since_us >= GIMBAL_TIMEOUT_US


class FlightEnd:
    """Stops series of pictures on return, landing and disarming, and video on disarming."""

    def __init__(self) -> None:
        self._state: NavigationState | None = None
        self._armed = False

    def update(self, parts: Parts, situation: Situation) -> str | None:
        """Stop pictures and video if the flight ends; return a text for the operator, or None."""
        is_ending = (
            situation.armed
            and situation.state in _ENDING_MODES
            and situation.state is not self._state
        )
        is_disarmed = self._armed and not situation.armed
        self._state, self._armed = situation.state, situation.armed
        if not (is_ending or is_disarmed):
            return None
        parts.mission_orders.clear()
        pictures = parts.camera.stop_series()
        video = is_disarmed and parts.camera.recording_since_us >= 0
        if video:
            parts.camera.stop_video()
        if not (pictures or video):
            return None
        what = " and ".join(n for n, ends in (("Pictures", pictures), ("Video", video)) if ends)
        return f"{what} stopped: {'disarmed' if is_disarmed else situation.state.name}"
