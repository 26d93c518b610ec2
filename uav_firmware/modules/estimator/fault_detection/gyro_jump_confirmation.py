"""Confirms by the estimate itself that the gyroscope bias has jumped.

What makes the filter reckon with a jump is a suspicion: innovations of velocity or heading that
drift. They have other causes, and to let the filter look costs nothing. An alarm needs more: the
bias that the filter finds must have moved by more than its own uncertainty, and stay there.
"""

import math
from typing import Final

from uav_firmware.msg.vectors import Vector3

_LEAST: Final = math.radians(0.5)  # [rad/s] A healthy bias is found anew to that after a suspicion
_CERTAIN: Final = 3.0  # [SD]
_SETTLED_US: Final = 600_000  # The first fixes after a suspicion swing
_STAYED_US: Final = 400_000
_GIVEN_UP_US: Final = 8_000_000


class GyroJumpConfirmation:
    """From a suspicion on, until it is confirmed or forgotten."""

    __slots__ = ("_before", "_off_since_us", "_suspected_us", "jumped_us")

    def __init__(self) -> None:
        self.jumped_us: int | None = None  # [us] When a jump was last confirmed
        self._before: Vector3 | None = None
        self._suspected_us = 0
        self._off_since_us: int | None = None

    def expect(self, bias_frd: Vector3, now_us: int) -> None:
        """Note the bias [rad/s] at a suspicion; one of the same series keeps the first bias."""
        if self._before is None:
            self._before = bias_frd
            self._off_since_us = None
        self._suspected_us = now_us

    def forget(self) -> None:
        """Drop the suspicion: the bias has changed with the sensor that is used."""
        self._before = None

    def update(self, bias_frd: Vector3, sigmas: Vector3, turning_rad_s: float, now_us: int) -> None:
        """Judge the bias and its standard deviations [rad/s].

        `turning_rad_s` is how large an error of scale factor and misalignment may be now; it
        counts as uncertainty of the bias.
        """
        before = self._before
        if before is None:
            return
        age_us = now_us - self._suspected_us
        off = age_us >= _SETTLED_US and any(
            abs(bias - old) > max(_LEAST, _CERTAIN * sigma) + turning_rad_s
            for bias, old, sigma in zip(bias_frd, before, sigmas, strict=True)
        )
        if not off:
            self._off_since_us = None
            if age_us > _GIVEN_UP_US:
                self._before = None
            return
        if self._off_since_us is None:
            self._off_since_us = now_us
        if now_us - self._off_since_us >= _STAYED_US:
            self.jumped_us, self._before = now_us, None
