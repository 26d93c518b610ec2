"""Detects from innovations that a quantity that the filter assumes constant has jumped.

Innovations of a filter whose sensor models are right have zero mean. When a rate that is integrated
jumps, they grow, and always to the same side: long before a single one is beyond its gate, their
sum is large. The sum is Page's (E. S. Page, "Continuous inspection schemes", Biometrika 41, 1954),
one for each side of each component, of innovations in their own deviations:

    sum <- max(0, sum +- innovation - slack)        reported above limit

A step is something else: a source that leaps, for which there is the gate. What has leapt is left
out until it is back. With `ramps` what has leapt and goes on growing to the same side counts as a
fast drift: a source that has stepped stays where it is.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

_GATE: Final = 5.0  # [SD] An innovation that has leapt is back when it is below
_RAMP: Final = 5.0  # [SD] Growth after a leap that a step does not have, twice in a row


class Drift(NamedTuple):
    """Innovations that have left their mean."""

    age_s: float  # [s] Since they began to exceed the slack
    growth: float  # [SD] Of the worst component since then


class InnovationCusum:
    """The sums of a vector of innovations, and since when they have grown."""

    __slots__ = (
        "_former",
        "_leap",
        "_leapt_from",
        "_limit",
        "_onset",
        "_ramps",
        "_slack",
        "_sums",
        "leapt",
    )

    def __init__(self, *, slack: float, limit: float, leap: float, ramps: bool = False) -> None:
        self._slack = slack  # [SD] Mean that is not reported
        self._limit = limit  # [SD] Sum that is reported
        self._leap = leap  # [SD] Between two innovations; no drift changes by so much
        self._former: Sequence[float] = ()
        self._ramps = ramps
        # When it leapt, the innovations before that and after it
        self._leapt_from: tuple[int, Sequence[float], Sequence[float]] | None = None
        self.leapt = False  # And not back yet
        self.restart()

    def restart(self) -> None:
        """Begin again after a report."""
        self._sums: list[float] = []
        self._onset: tuple[int, Sequence[float]] | None = None

    def update(self, innovations: Sequence[float], now_us: int) -> Drift | None:
        """Add a vector of innovations [SD]; how it drifts, if it does."""
        former = self._former or innovations
        self._former = innovations
        if self._leaps(innovations, former):
            ramp = self._ramp(innovations, former, now_us)
            self.restart()
            return ramp
        self._leapt_from = None
        slack = self._slack
        if self._onset is None and max(innovations) <= slack and min(innovations) >= -slack:
            return None  # The usual case: nothing adds up
        signed = [*innovations, *(-innovation for innovation in innovations)]
        sums = self._sums or [0.0] * len(signed)
        self._sums = sums = [
            max(0.0, total + x - slack) for total, x in zip(sums, signed, strict=True)
        ]
        largest = max(sums)
        if largest == 0.0:
            self._onset = None
            return None
        if self._onset is None:
            self._onset = (now_us, innovations)
        if largest < self._limit:
            return None
        since_us, first = self._onset
        growth = max(abs(new - old) for new, old in zip(innovations, first, strict=True))
        self.restart()
        return Drift((now_us - since_us) * 1e-6, growth)

    def _leaps(self, innovations: Sequence[float], former: Sequence[float]) -> bool:
        """Whether a component has leapt, and is not back yet."""
        leap = self._leap
        for new, old in zip(innovations, former, strict=True):
            if abs(new - old) > leap:
                self.leapt = True
                return True
        if self.leapt and max(map(abs, innovations)) < _GATE:
            self.leapt = False
        return self.leapt

    def _ramp(
        self, innovations: Sequence[float], former: Sequence[float], now_us: int
    ) -> Drift | None:
        """Whether what has leapt goes on growing to the side that it has leapt to."""
        if not self._ramps:
            return None
        if self._leapt_from is None:
            self._leapt_from = (now_us, former, innovations)
            return None
        since_us, before, after = self._leapt_from
        grown = [
            abs(new - start)
            for new, old, start, base in zip(innovations, former, before, after, strict=True)
            if (new - base) * (base - start) > 0.0 and min(abs(new - base), abs(old - base)) > _RAMP
        ]
        if not grown:
            return None
        self._leapt_from = None
        self.leapt = False
        return Drift((now_us - since_us) * 1e-6, max(grown))
