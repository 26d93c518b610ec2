"""Directions of the pictures of a panorama, and their sequence. Pure.

AFarCloud's panoramas are DJI's: a full circle is 8 pictures at 45 degrees, a half circle 5, from
90 degrees left to 90 degrees right. Other angles use the same steps; a vertical angle has rows at
most 30 degrees apart.
"""

import math
from collections.abc import Sequence
from enum import Enum
from typing import Final

from uav_firmware.lib.rotation import wrap_pi
from uav_firmware.modules.payload.camera.gimbal import PITCH_MAX, PITCH_MIN, Angles

STEP_DEG: Final = 45.0
ROW_STEP_DEG: Final = 30.0
STEEPEST_DEG: Final = -45.0
"""[deg] Below this pitch neighbouring pictures show the same ground."""
ALL_ROUND_DEG: Final = -10.0
"""[deg] Pitch used instead: the horizon with a strip of sky."""
SETTLE_US: Final = 200_000
"""[us] Wait after the gimbal has arrived."""
_FULL_DEG: Final = 360.0


class Phase(Enum):
    """Current activity of a panorama."""

    TURNING = "turning"
    SHOOTING = "shooting"
    DONE = "done"


def directions(
    horizontal_deg: float, vertical_deg: float, pitch: float, yaw: float
) -> tuple[tuple[float, float], ...]:
    """Pitch and yaw from north [rad] of each picture, centred on the present direction.

    A single row below `STEEPEST_DEG` is raised to `ALL_ROUND_DEG`.

    Raises:
        ValueError: if a row is outside the gimbal's range of pitch.
    """
    if horizontal_deg >= _FULL_DEG:
        offsets = [math.radians(STEP_DEG * i) for i in range(round(_FULL_DEG / STEP_DEG))]
    else:
        offsets = _spread(horizontal_deg, STEP_DEG)
    if vertical_deg <= 0.0 and pitch < math.radians(STEEPEST_DEG):
        pitch = math.radians(ALL_ROUND_DEG)
    pitches = [pitch + offset for offset in _spread(vertical_deg, ROW_STEP_DEG)]
    if min(pitches) < PITCH_MIN - 1e-6 or max(pitches) > PITCH_MAX + 1e-6:
        raise ValueError("a row is outside the gimbal's range of pitch")
    return tuple((row, wrap_pi(yaw + offset)) for row in pitches for offset in offsets)


def _spread(angle_deg: float, step_deg: float) -> list[float]:
    """Angles [rad] from minus half to plus half, at most a step apart; [0] for an angle of 0."""
    steps = math.ceil(angle_deg / step_deg - 1e-9)
    if steps <= 0:
        return [0.0]
    return [math.radians(angle_deg * (i / steps - 0.5)) for i in range(steps + 1)]


class Panorama:
    """Steps through the directions; `phase` is the current activity."""

    def __init__(
        self, shots: Sequence[tuple[float, float]], rate_yaw: float, rate_pitch: float
    ) -> None:
        self._shots = shots
        self._rates = (rate_pitch, rate_yaw)
        self._since_us: int | None = None  # When the gimbal arrived
        self.taken = 0

    @property
    def progress(self) -> int:
        """Share of the pictures taken [%]."""
        return 100 * self.taken // len(self._shots)

    @property
    def aim(self) -> Angles:
        """Direction of the next picture."""
        pitch, yaw = self._shots[min(self.taken, len(self._shots) - 1)]
        return Angles(pitch, yaw, locked=True, rate_pitch=self._rates[0], rate_yaw=self._rates[1])

    def phase(self, now_us: int, *, settled: bool) -> Phase:
        """Return the activity; `settled` is whether the gimbal has arrived."""
        if self.taken >= len(self._shots):
            return Phase.DONE
        if not settled:
            self._since_us = None
        elif self._since_us is None:
            self._since_us = now_us
        if self._since_us is None or now_us - self._since_us < SETTLE_US:
            return Phase.TURNING
        return Phase.SHOOTING

    def note_picture(self) -> None:
        """Count the picture of the current direction as taken."""
        self.taken += 1
        self._since_us = None
