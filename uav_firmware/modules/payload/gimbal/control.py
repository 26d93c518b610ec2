"""Who points the gimbal: pure.

MAVLink's gimbal manager (services/gimbal_v2): a controller takes control before it points. One
controller is primary, another one may be secondary; both are heard.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from uav_firmware.msg.payload import Controller

NOBODY: Final = Controller(0, 0)
_UNCHANGED: Final = -1.0
_SENDER: Final = -2.0
_RELEASE: Final = -3.0


class GimbalControl(NamedTuple):
    """The two places of control."""

    primary: Controller = NOBODY
    secondary: Controller = NOBODY

    def admits(self, sender: Controller) -> bool:
        """Whether a sender may point the gimbal."""
        return sender != NOBODY and sender in {self.primary, self.secondary}

    def taken_by(self, sender: Controller) -> "GimbalControl":
        """Control in the hands of one sender."""
        return self if sender == self.primary else self._replace(primary=sender)

    def configured(self, parameters: Sequence[float], sender: Controller) -> "GimbalControl":
        """After DO_GIMBAL_MANAGER_CONFIGURE with its parameters 1 to 4."""
        return GimbalControl(
            _assigned(self.primary, parameters[0], parameters[1], sender),
            _assigned(self.secondary, parameters[2], parameters[3], sender),
        )


def _assigned(
    present: Controller, system: float, component: float, sender: Controller
) -> Controller:
    if _SENDER in {system, component}:
        return sender
    if _RELEASE in {system, component}:
        return NOBODY if present == sender else present
    if math.isnan(system) or system == _UNCHANGED:
        return present
    if system == 0.0:
        return NOBODY
    kept = math.isnan(component) or component == _UNCHANGED
    return Controller(int(system), present.component_id if kept else int(component))
