"""Touch-down: the vehicle is led down, does not sink, and the rotors do not carry it.

Then something else does. Less thrust than the weight, held for HOLD_S in free air, would make it
sink by more than a third of a metre per second: what does not move stands on the ground. From then
on the vehicle stays level and takes the thrust away, since every tilt of a vehicle on the ground
lifts one side, and wind pushes what stands light and lopsided over. Should it sink after all, the
sign is gone at once and the trajectory leads again.

A vertical velocity of which little is known does not stand still when the vehicle does: what is
within three of its deviations counts as none.
"""

import math
from typing import Final

from uav_firmware.modules.position_control.controller import Motion
from uav_firmware.modules.position_control.wanted_motion import BLIND, LEVEL

HOLD_S: Final = 0.3
_LED_DOWN_M_S: Final = 0.1
_SINKING_SHARE: Final = 0.5  # Of the speed asked for
_STILL_SIGMAS: Final = 3.0
_LARGEST_STILL_M_S: Final = 1.0  # What does not carry the weight is faster within half a second
_WEIGHT_SHARE: Final = 0.88  # Of the hover thrust; what touches the ground asks for less at once


class TouchDown:
    """Since when the sign has held [s]."""

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
        asked = wanted.velocity_ned[2]
        doubt_m_s = min(_STILL_SIGMAS * sink_accuracy_m_s, _LARGEST_STILL_M_S)
        carried = (
            math.isnan(wanted.position_ned[2])
            and asked > _LED_DOWN_M_S  # false for NaN
            and abs(sink_speed_m_s) < max(_SINKING_SHARE * asked, doubt_m_s)
            and hover_share < _WEIGHT_SHARE
        )
        if not carried:
            self._since_s = None
        elif self._since_s is None:
            self._since_s = now_s
        return self._since_s is not None and now_s - self._since_s >= HOLD_S


def settle(sink_speed_m_s: float) -> Motion:
    """Level, and down at a speed that takes the thrust away."""
    return Motion(BLIND, (math.nan, math.nan, sink_speed_m_s), LEVEL)
