"""Mid-value selection over the gyroscopes, or the accelerometers, of several inertial units.

Three healthy instances give the median of each axis: no failure of one of them ever reaches the
output, however fast, and nothing has to be detected for that. Two give their mean, one itself. The
classic scheme of flight control (S. Osder, "Practical view of redundancy management", J. Guidance
22, 1999); PX4 instead follows one instance and changes to another (`DataValidatorGroup`, one EKF2
per unit), which needs resets and lets the failure in until it is detected.

What has failed is found at leisure, over windows of a fifth of a second:

    no number     not finite in more than two samples of a window; where that leaves none, in
                  every sample of it
    stuck         every sample of the window the same, while another sensor of the vehicle changes
    biased        its mean is off the median's for several windows, by more than noise and scale do

and stays failed until a restart. Differences that instances have from the start are learnt within
what a calibration leaves, so that a jump shows sooner. Of two instances that disagree the vote
cannot decide which is wrong: they are disputed until one is excluded (`give_up`), by
`DisputeByBias`.
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_firmware.msg.vectors import Vector3

Array = NDArray[np.float64]

WINDOW: Final = 25  # [samples] 0.2 s, of every other one at 250 Hz
_FORGIVEN: Final = 2  # [samples] Without a number in a window: a glitch of the bus
_SMOOTHING: Final = 0.3  # [-] Share of a window in the mean difference; 0.6 s
_LEARNING: Final = 0.01  # [-] Share of a window in the learnt difference; 20 s
_NOISE_GATE: Final = 5.0  # [SD] Of the smoothed mean of a window
_THREE: Final = 3
_MEMORY_US: Final = 1_500_000  # A dispute shows within that
_CLEAR: Final = 0.25  # [-] Of the disagreement: halfway to what a sensor that is wrong gives
_NOTHING: Final[Vector3] = (math.nan, math.nan, math.nan)


class Limits(NamedTuple):
    """How far healthy instances may be apart, in the unit of the sensor."""

    bias: float  # What a healthy one is off by, at rest
    scale: float  # [-] And for each unit measured: scale factor and misalignment
    usual: float  # What is measured at rest; a scale factor there is learnt
    standing: float  # A difference up to this counts as calibration, and is learnt


class Failed(NamedTuple):
    """An instance that has just failed."""

    instance: int
    reason: str


class TriadVote:
    """The instances of one kind of sensor."""

    def __init__(self, count: int, limits: Limits) -> None:
        self.limits = limits
        self.good: tuple[int, ...] = tuple(range(count))
        self.failed = 0  # [-] Bit 0 is the first instance
        self.dispute: Vector3 | None = None  # First minus second of two that disagree
        self._learnt = np.zeros((count, 3))
        self._apart = np.zeros((count, 3))
        self._windows = 0
        self._size = 0.0

    def select(self, vectors: Sequence[Vector3]) -> Vector3:
        """The vector to use, of one sample of every instance; not a number if none is left."""
        good = self.good
        if len(good) == _THREE:
            return self.select_of_three(vectors[good[0]], vectors[good[1]], vectors[good[2]])
        return _mean_of([vectors[i] for i in good])

    def select_of_three(self, a: Vector3, b: Vector3, c: Vector3) -> Vector3:
        """As `select`, of the vectors of three good instances."""
        ax, ay, az = a
        bx, by, bz = b
        cx, cy, cz = c
        total = ax + ay + az + bx + by + bz + cx + cy + cz
        if total - total != 0.0:
            return _mean_of((a, b, c))
        return (
            ax
            if bx <= ax <= cx or cx <= ax <= bx
            else bx
            if ax <= bx <= cx or cx <= bx <= ax
            else cx,
            ay
            if by <= ay <= cy or cy <= ay <= by
            else by
            if ay <= by <= cy or cy <= by <= ay
            else cy,
            az
            if bz <= az <= cz or cz <= az <= bz
            else bz
            if az <= bz <= cz or cz <= bz <= az
            else cz,
        )

    def judge(self, window: Array, others: Array) -> list[Failed]:
        """Check a window of samples, shape (WINDOW, instances, 3); returns the failures in it.

        `others` are the samples of another kind of sensor in the same time.
        """
        failures = []
        finite = np.isfinite(window)
        is_whole = bool(finite.all())
        if not is_whole:
            missing = np.count_nonzero(~finite.all(axis=2), axis=0)
            silent = [i for i in self.good if missing[i] > _FORGIVEN]
            if len(silent) == len(self.good):  # A bus that resets; nothing is left to use instead
                silent = [i for i in silent if missing[i] == len(window)]
            failures = [Failed(i, "no data") for i in silent]
        changed = changes(window)
        stuck = [i for i in self.good if not changed[i]]
        if stuck and (len(stuck) < len(self.good) or changes(others).any()):
            failures += [Failed(i, "stuck") for i in stuck]
        for failure in failures:
            self.give_up(failure.instance)
        return failures + self._compare(window, is_whole=is_whole)

    def give_up(self, instance: int) -> None:
        """Do without an instance from now on."""
        self.failed |= 1 << instance
        self.good = tuple(i for i in self.good if i != instance)
        self.dispute = None

    def _compare(self, window: Array, *, is_whole: bool) -> list[Failed]:
        """Whether an instance is off the others; `is_whole`: every number is finite."""
        good = list(self.good)
        self.dispute = None
        if len(good) < 2:
            return []
        # All of them as a view: indexing by a list copies, and costs as much as what follows
        used = slice(None) if len(good) == len(self._learnt) else good
        samples = window[:, used] - self._learnt[used]
        if not is_whole:
            samples = samples[np.isfinite(samples).all(axis=(1, 2))]
        if len(samples) < WINDOW // 2:
            return []
        means = _mean(samples, axis=0)
        # The median, for which numpy takes ten times as long
        middle = np.sort(means, axis=0)[1] if len(good) == _THREE else 0.5 * (means[0] + means[1])
        # The length, for which numpy.linalg.norm takes five times as long to the same bits
        size = abs(math.sqrt(middle.dot(middle)) - self.limits.usual)
        self._size = max(size, 0.8 * self._size)
        off = means - middle
        # Of what one instance and not another has measured: motion is common to them
        own = samples - _mean(samples, axis=1)[:, None]
        own -= _mean(own, axis=0)
        noise = math.sqrt(float(_mean(own * own, axis=0).max())) / math.sqrt(len(samples))
        self._apart[used] += _SMOOTHING * (off - self._apart[used])
        limit = (
            self.limits.bias
            + self.limits.scale * self._size
            + _NOISE_GATE * noise * math.sqrt(_SMOOTHING / (2.0 - _SMOOTHING))
        )
        apart = self._apart[used]
        apart = np.sqrt(np.add.reduce(apart * apart, axis=1))
        if len(good) == 2:
            if 2.0 * apart[0] > limit:
                x, y, z = (2.0 * self._apart[good[0]]).tolist()
                self.dispute = (x, y, z)
                return []
        else:
            worst = int(np.argmax(apart))
            if apart[worst] > limit:
                self.give_up(good[worst])
                return [Failed(good[worst], "biased")]
        if float(apart.max()) < 0.5 * limit:
            self._learn(used, off)
        return []

    def _learn(self, used: slice | list[int], off: Array) -> None:
        """Take the standing differences into account, as far as a calibration leaves them."""
        self._windows += 1
        self._learnt[used] += max(1.0 / self._windows, _LEARNING) * off
        standing = self.limits.standing
        learnt = self._learnt  # numpy.clip takes three times as long
        np.maximum(learnt, -standing, out=learnt)
        np.minimum(learnt, standing, out=learnt)


def _mean_of(vectors: Sequence[Vector3]) -> Vector3:
    """Mean of the vectors that are numbers."""
    usable = [vector for vector in vectors if math.isfinite(sum(vector))]
    if not usable:
        return _NOTHING
    number = 1.0 / len(usable)
    x, y, z = (number * sum(axis) for axis in zip(*usable, strict=True))
    return (x, y, z)


class FailedOfTwo(NamedTuple):
    """The end of a dispute."""

    which: int  # 0 the first of the two is wrong, 1 the second
    shift_frd: Vector3  # By which the estimator's bias has to change


class DisputeByBias:
    """Decides which of two units that disagree is wrong, by the bias that the estimator has found.

    The estimator flies by the mean of the two. When the first is off by d, the mean is off by d/2,
    and the bias that the estimator finds by GPS and barometer moves by d/2; when it is the second,
    by -d/2. The bias before the dispute is the right one for the sensor that stays.
    """

    def __init__(self) -> None:
        self._past: deque[tuple[int, Vector3]] = deque()
        self._before: Vector3 | None = None

    def update(self, apart: Vector3 | None, bias_frd: Vector3, now_us: int) -> FailedOfTwo | None:
        """Compare the bias before and after a dispute.

        `apart` is the first's reading minus the second's, None without a dispute.
        """
        past = self._past
        if apart is None:
            self._before = None
            past.append((now_us, bias_frd))
            while now_us - past[0][0] > _MEMORY_US:
                past.popleft()
            return None
        if self._before is None:
            self._before = past[0][1] if past else bias_frd
            past.clear()
        moved = tuple(new - old for new, old in zip(bias_frd, self._before, strict=True))
        along = sum((m * d for m, d in zip(moved, apart, strict=True)), 0.0)
        share = along / sum((d * d for d in apart), 0.0)
        if abs(share) < _CLEAR:
            return None
        x, y, z = moved
        return FailedOfTwo(0 if share > 0.0 else 1, (-x, -y, -z))


def changes(window: Array) -> NDArray[np.bool_]:
    """Which instances do not repeat one sample throughout a window."""
    changed: NDArray[np.bool_] = (window[1] != window[0]).any(axis=1)
    if changed.all():  # The usual case, for which two samples are enough
        return changed
    throughout: NDArray[np.bool_] = (window != window[0]).any(axis=(0, 2))
    return throughout


def _mean(numbers: Array, axis: int) -> Array:
    """Mean along an axis, without the checks by which numpy's own takes twice as long."""
    mean: Array = np.add.reduce(numbers, axis=axis)
    mean /= numbers.shape[axis]
    return mean
