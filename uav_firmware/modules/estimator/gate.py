"""Innovation gates, and what is remembered of each source of measurements."""

from collections.abc import Sequence

from uav_firmware.modules.estimator.ekf import ErrorStateEkf, Measurement


def worst_ratio(ekf: ErrorStateEkf, measurements: Sequence[Measurement], gate: float) -> float:
    """Largest innovation over `gate` expected deviations: above 1 the group is an outlier."""
    return max(abs(m.innovation) / (gate * ekf.deviation(m)) for m in measurements)


class Aid:
    """One source of measurements: how well it agrees and when it last helped."""

    __slots__ = ("_rejecting_since_us", "fused_us", "gate", "ratio", "ready_us")

    def __init__(self, gate: float) -> None:
        self.gate = gate  # [-] Standard deviations that an innovation may reach
        self.ratio = 0.0  # [-] Of the last measurement; below 1 is good
        self.fused_us: int | None = None  # [us] None before the first
        self.ready_us = 0  # [us] From when on a rate-limited source may be fused again
        self._rejecting_since_us: int | None = None

    def fuse(
        self,
        ekf: ErrorStateEkf,
        group: Sequence[Measurement],
        now_us: int,
    ) -> bool:
        """Fuse the whole group if each of its scalars passes the gate, else nothing of it."""
        self.ratio = worst_ratio(ekf, group, self.gate)
        if self.ratio > 1.0:
            if self._rejecting_since_us is None:
                self._rejecting_since_us = now_us
            return False
        ekf.fuse(group)
        self.accept(now_us)
        return True

    def accept(self, now_us: int) -> None:
        """Note that the source and the estimate agree, by fusion or by a reset."""
        self.fused_us = now_us
        self._rejecting_since_us = None

    def age_s(self, now_us: int) -> float:
        """Time since it last helped [s]; infinite if it never did."""
        return float("inf") if self.fused_us is None else (now_us - self.fused_us) * 1e-6

    def rejected_s(self, now_us: int) -> float:
        """For how long everything from it has been rejected [s]; 0 while it is accepted."""
        since = self._rejecting_since_us
        return 0.0 if since is None else (now_us - since) * 1e-6

    @property
    def rejecting(self) -> bool:
        """Whether its last measurement was rejected."""
        return self._rejecting_since_us is not None
