"""Touch-down: the vehicle is commanded to descend, does not sink, and its thrust is too low.

Then the ground carries it. Less thrust than the weight, held for HOLD_S in free air, would make it
sink by more than a third of a metre per second: without motion it stands on the ground. From then
on the vehicle stays level and takes the thrust away, since every tilt of a vehicle on the ground
lifts one side, and wind overturns a vehicle that stands tilted on little weight. If it sinks after
all, the touch-down ends at once and the trajectory is followed again.
"""

import math
from typing import Final

from uav_firmware.lib.ground_contact import does_not_sink
from uav_firmware.modules.position_control.controller import Motion
from uav_firmware.modules.position_control.wanted_motion import BLIND, LEVEL

HOLD_S: Final = 0.3
_WEIGHT_SHARE: Final = 0.88  # Of the hover thrust; what touches the ground asks for less at once


class TouchDown:
    """Time [s] since when the conditions of a touch-down hold."""

    __slots__ = ("_since_s",)

    def __init__(self) -> None:
        self._since_s: float | None = None

    def update(
        self,
        now_s: float,
        wanted: Motion,
        sink_speed_m_s: float,
        hover_share: float,
        sink_accuracy_m_s: float = 0.0,
    ) -> bool:
        """Whether the ground carries; `hover_share` is the thrust over that of a hover."""
        carried = (
            math.isnan(wanted.position_ned[2])
            and does_not_sink(sink_speed_m_s, wanted.velocity_ned[2], sink_accuracy_m_s)
            and hover_share < _WEIGHT_SHARE
        )
        if not carried:
            self._since_s = None
        elif self._since_s is None:
            self._since_s = now_s
        return self._since_s is not None and now_s - self._since_s >= HOLD_S


def settle(sink_speed_m_s: float) -> Motion:
    """Level, and down at a speed that takes the thrust away."""
    return Motion(BLIND, (math.nan, math.nan, sink_speed_m_s), LEVEL, holds=True)
