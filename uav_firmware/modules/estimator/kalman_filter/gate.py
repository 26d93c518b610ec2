"""Innovation gates, and what is remembered of each source of measurements."""

from collections.abc import Sequence
from typing import Final

from uav_firmware.modules.estimator.kalman_filter.covariance import Measurement
from uav_firmware.modules.estimator.kalman_filter.ekf import ErrorStateEkf

STOP_AFTER_S: Final = 5.0
"""A source rejected for so long is stopped (PX4's hgt_fusion_timeout_max)."""

FORGIVEN_SHARE: Final = 0.25
"""[-] Of the time for which a source agrees, taken off the time for which it was rejected.

One that comes and goes is stopped too, if it is wrong for more than a fifth of the time.
"""

RECEIVER_GAP_US: Final = 500_000
"""[us] A GPS receiver that was silent for longer has begun anew."""

_LONGEST_STEP_S: Final = 1.0  # A silence proves nothing

_DOUBTED_RATIO: Final = 1.01  # [-] Beyond the gate

RESUME_AFTER_S: Final = 2.0
"""A stopped source is used again after agreeing for so long without a break."""


def worst_ratio(ekf: ErrorStateEkf, measurements: Sequence[Measurement], gate: float) -> float:
    """Largest innovation over `gate` expected deviations: above 1 the group is an outlier."""
    return max(abs(m.innovation) / (gate * ekf.deviation(m)) for m in measurements)


class Aid:
    """One source of measurements: how well it agrees, when it last helped, whether it is stopped.

    USED    --a measurement beyond the gate--------> DOUBTED
    DOUBTED --a measurement within it--------------> USED
    DOUBTED --STOP_AFTER_S in all, see below-------> STOPPED   not fused, reported
    STOPPED --for RESUME_AFTER_S, all within it----> USED
    any     --the estimate is reset to it----------> USED

    The time of rejection runs between two measurements that are both beyond the gate, so that
    a single outlier costs nothing; agreement takes FORGIVEN_SHARE of its own time off it.
    """

    __slots__ = ("_agreeing_since_us", "_doubt_s", "_judged_us", "_rejecting_since_us", "_stopped",
                 "fused_us", "gate", "ratio", "ready_us")  # fmt: skip

    def __init__(self, gate: float) -> None:
        self.gate = gate  # [-] Standard deviations that an innovation may reach
        self.ratio = 0.0  # [-] Of the last measurement; below 1 is good
        self.fused_us: int | None = None  # [us] None before the first
        self.ready_us = 0  # [us] From when on a rate-limited source may be fused again
        self._rejecting_since_us: int | None = None
        self._agreeing_since_us: int | None = None  # While it is stopped
        self._stopped = False
        self._doubt_s = 0.0  # [s] Time of rejection that is not forgiven yet
        self._judged_us: int | None = None  # [us] The last measurement

    def fuse(
        self,
        ekf: ErrorStateEkf,
        group: Sequence[Measurement],
        now_us: int,
        *,
        doubted: bool = False,
    ) -> bool:
        """Fuse the whole group if each of its scalars passes the gate, else nothing of it.

        One that is `doubted` for another reason is not used again after a rejection.
        """
        self.ratio = worst_ratio(ekf, group, self.gate)
        if doubted and self.rejecting:
            self.ratio = max(self.ratio, _DOUBTED_RATIO)
        if not self._admits(now_us):
            return False
        ekf.fuse(group)
        self._use(now_us)
        return True

    def _admits(self, now_us: int) -> bool:
        """Judge the last ratio; whether its measurement may be fused."""
        before_us, self._judged_us = self._judged_us, now_us
        step_s = 0.0 if before_us is None else min((now_us - before_us) * 1e-6, _LONGEST_STEP_S)
        if self.ratio > 1.0:
            if self._rejecting_since_us is not None and self._agreeing_since_us is None:
                self._doubt_s += step_s
            self._agreeing_since_us = None
            if self._rejecting_since_us is None:
                self._rejecting_since_us = now_us
            self._stopped = self._stopped or self._doubt_s > STOP_AFTER_S
            return False
        self._doubt_s = max(0.0, min(self._doubt_s, STOP_AFTER_S) - FORGIVEN_SHARE * step_s)
        if not self._stopped:
            return True
        if self._agreeing_since_us is None:
            self._agreeing_since_us = now_us
        return (now_us - self._agreeing_since_us) * 1e-6 >= RESUME_AFTER_S

    def accept(self, now_us: int) -> None:
        """Note that the estimate has been reset to the source."""
        self._use(now_us)
        self._doubt_s = 0.0

    def _use(self, now_us: int) -> None:
        self.fused_us = now_us
        self._rejecting_since_us = self._agreeing_since_us = None
        self._stopped = False

    def age_s(self, now_us: int) -> float:
        """Time since it last helped [s]; infinite if it never did."""
        return float("inf") if self.fused_us is None else (now_us - self.fused_us) * 1e-6

    def rejected_s(self, now_us: int) -> float:
        """For how long nothing from it has been fused since a rejection [s]; 0 while it is."""
        since = self._rejecting_since_us
        return 0.0 if since is None else (now_us - since) * 1e-6

    @property
    def rejecting(self) -> bool:
        """Whether its last measurement was not fused."""
        return self._rejecting_since_us is not None

    @property
    def stopped(self) -> bool:
        """Whether it has disagreed for so long that it is not used until it agrees again."""
        return self._stopped
