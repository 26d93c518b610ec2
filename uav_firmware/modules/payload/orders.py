"""Every order to the payload: judged, carried out, answered.

An order from a link is carried out or refused at once. The mission's orders are carried out one
after the other: each waits until what the one before began allows it, so that none is lost
however many follow each other, and each picture looks where the mission has said before it.
"""

from collections.abc import Mapping
from typing import Final

from uav_firmware.lib.payload_rules import fault_of
from uav_firmware.modules.payload.camera import camera_orders
from uav_firmware.modules.payload.camera.states import CameraBusyError, CameraState
from uav_firmware.modules.payload.gimbal import gimbal_orders
from uav_firmware.modules.payload.parts import Parts
from uav_firmware.modules.payload.situation import Outcome, Situation, denied, not_now
from uav_firmware.msg.payload import PayloadCommand
from uav_firmware.msg.status import CommandResult, VehicleCommand

GIMBAL_PATIENCE_US: Final = 5_000_000
"""[us] A picture of the mission waits no longer for the gimbal."""

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


def carry_out(command: VehicleCommand, parts: Parts, situation: Situation) -> Outcome:
    """Do what a command says, or refuse it."""
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
        outcome = not_now(str(error))
    if outcome.reason:
        return outcome._replace(reason=f"{name} refused: {outcome.reason}")
    return outcome


class MissionOrders:
    """The mission's orders that still wait."""

    def __init__(self) -> None:
        self._since_us: int | None = None  # Since when the first order waits for the gimbal

    def update(self, parts: Parts, situation: Situation) -> list[Outcome]:
        """Carry out what may begin now; gives the outcomes that are refusals."""
        refusals: list[Outcome] = []
        orders = parts.mission_orders
        while orders and self._may_begin(orders[0], parts, situation.now_us):
            outcome = carry_out(orders[0], parts, situation)
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

    def _may_begin(self, order: VehicleCommand, parts: Parts, now_us: int) -> bool:
        if order.command in gimbal_orders.HANDLERS:
            return parts.camera.state is not CameraState.SINGLE
        if order.command not in _PICTURES or parts.gimbal.settled:
            return True
        if self._since_us is None:
            self._since_us = now_us
        return now_us - self._since_us >= GIMBAL_PATIENCE_US
