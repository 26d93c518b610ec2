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

from uav_firmware.lib.vector import norm, subtract
from uav_firmware.msg.vectors import Vector3

Window = list[list[Vector3]]
"""Samples, of the vectors of all instances."""

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

    instance: int  # [-] From 0
    reason: str  # For the operator


class TriadVote:
    """The instances of one kind of sensor."""

    def __init__(self, count: int, limits: Limits) -> None:
        self.limits = limits
        self.good: tuple[int, ...] = tuple(range(count))
        self.failed = 0  # [-] Bit 0 is the first instance
        self.dispute: Vector3 | None = None  # First minus second of two that disagree
        self._learnt: list[Vector3] = [(0.0, 0.0, 0.0)] * count
        self._apart: list[Vector3] = [(0.0, 0.0, 0.0)] * count
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

    @property
    def agree(self) -> bool:
        """Whether several instances measure the same, and none ever did not.

        After a failure it is no proof any more: two that failed alike have outvoted the third.
        """
        return len(self.good) > 1 and self.failed == 0 and self.dispute is None

    def judge(self, window: Window, others: Window) -> list[Failed]:
        """Check WINDOW samples, each the vectors of all instances; returns the failures in them.

        `others` are the samples of another kind of sensor in the same time.
        """
        failures = []
        missing = {i: _missing(window, i) for i in self.good}
        is_whole = not any(missing.values())
        if not is_whole:
            silent = [i for i in self.good if missing[i] > _FORGIVEN]
            if len(silent) == len(self.good):  # A bus that resets; nothing is left to use instead
                silent = [i for i in silent if missing[i] == len(window)]
            failures = [Failed(i, "no data") for i in silent]
        stuck = [i for i in self.good if not _changes(window, i)]
        if stuck and (
            len(stuck) < len(self.good) or any(_changes(others, i) for i in range(len(others[0])))
        ):
            failures += [Failed(i, "stuck") for i in stuck]
        for failure in failures:
            self.give_up(failure.instance)
        if not is_whole:
            window = [sample for sample in window if all(_is_finite(sample[i]) for i in self.good)]
        return failures + self._compare(window)

    def give_up(self, instance: int) -> None:
        """Do without an instance from now on."""
        self.failed |= 1 << instance
        self.good = tuple(i for i in self.good if i != instance)
        self.dispute = None

    def _compare(self, samples: Window) -> list[Failed]:
        """Whether an instance is off the others, in samples of which every number is finite."""
        good = self.good
        self.dispute = None
        if len(good) < 2 or len(samples) < WINDOW // 2:
            return []
        means, noise = _mean_and_noise(samples, good)
        means = [subtract(mean, self._learnt[i]) for mean, i in zip(means, good, strict=True)]
        middle = self.select_of_three(*means) if len(good) == _THREE else _mean_of(means)
        size = abs(norm(middle) - self.limits.usual)
        self._size = max(size, 0.8 * self._size)
        limit = (
            self.limits.bias
            + self.limits.scale * self._size
            + _NOISE_GATE * noise * math.sqrt(_SMOOTHING / (2.0 - _SMOOTHING))
        )
        off = [subtract(mean, middle) for mean in means]
        for i, new in zip(good, off, strict=True):
            self._apart[i] = _towards(self._apart[i], new, _SMOOTHING)
        apart = [norm(self._apart[i]) for i in good]
        if len(good) == 2:
            if 2.0 * apart[0] > limit:
                x, y, z = self._apart[good[0]]
                self.dispute = (2.0 * x, 2.0 * y, 2.0 * z)
                return []
        else:
            worst = apart.index(max(apart))
            if apart[worst] > limit:
                self.give_up(good[worst])
                return [Failed(good[worst], "biased")]
        if max(apart) < 0.5 * limit:
            self._learn(off)
        return []

    def _learn(self, off: list[Vector3]) -> None:
        """Take the standing differences into account, as far as a calibration leaves them."""
        self._windows += 1
        share, standing = max(1.0 / self._windows, _LEARNING), self.limits.standing
        for i, (x, y, z) in zip(self.good, off, strict=True):
            learnt_x, learnt_y, learnt_z = self._learnt[i]
            self._learnt[i] = (
                min(max(learnt_x + share * x, -standing), standing),
                min(max(learnt_y + share * y, -standing), standing),
                min(max(learnt_z + share * z, -standing), standing),
            )


def _mean_of(vectors: Sequence[Vector3]) -> Vector3:
    """Mean of the vectors that are numbers."""
    usable = [vector for vector in vectors if math.isfinite(sum(vector))]
    if not usable:
        return _NOTHING
    number = 1.0 / len(usable)
    x, y, z = (number * sum(axis) for axis in zip(*usable, strict=True))
    return (x, y, z)


def _mean_and_noise(samples: Window, good: tuple[int, ...]) -> tuple[list[Vector3], float]:
    """Mean of each good instance; standard deviation of a mean by what one alone has measured.

    Motion is common to all instances: the noise is that of the differences from their mean, of the
    axis and the instance with the most of it.
    """
    common = [_mean_over(sample, good) for sample in samples]
    number = 1.0 / len(samples)
    means: list[Vector3] = []
    largest = 0.0
    for i in good:
        total_x = total_y = total_z = 0.0
        own_x = own_y = own_z = square_x = square_y = square_z = 0.0
        for sample, (common_x, common_y, common_z) in zip(samples, common, strict=True):
            x, y, z = sample[i]
            total_x, total_y, total_z = total_x + x, total_y + y, total_z + z
            x, y, z = x - common_x, y - common_y, z - common_z
            own_x, own_y, own_z = own_x + x, own_y + y, own_z + z
            square_x, square_y, square_z = square_x + x * x, square_y + y * y, square_z + z * z
        means.append((number * total_x, number * total_y, number * total_z))
        largest = max(
            largest,
            number * square_x - (number * own_x) ** 2,
            number * square_y - (number * own_y) ** 2,
            number * square_z - (number * own_z) ** 2,
        )
    return means, math.sqrt(number * largest)


def _mean_over(sample: list[Vector3], good: tuple[int, ...]) -> Vector3:
    total_x = total_y = total_z = 0.0
    for i in good:
        x, y, z = sample[i]
        total_x, total_y, total_z = total_x + x, total_y + y, total_z + z
    share = 1.0 / len(good)
    return (share * total_x, share * total_y, share * total_z)


def _towards(old: Vector3, new: Vector3, share: float) -> Vector3:
    """Move by a share of the way."""
    x, y, z = subtract(new, old)
    return (old[0] + share * x, old[1] + share * y, old[2] + share * z)


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


def _is_finite(vector: Vector3) -> bool:
    x, y, z = vector
    total = x + y + z
    return total - total == 0.0


def _missing(window: Window, instance: int) -> int:
    """In how many samples an instance has something that is no number."""
    missing = 0
    for sample in window:
        if not _is_finite(sample[instance]):
            missing += 1
    return missing


def _changes(window: Window, instance: int) -> bool:
    """Whether an instance does not repeat one sample throughout a window."""
    first_x, first_y, first_z = window[0][instance]
    for sample in window:  # The second ends it, mostly; the first, if it is no number
        x, y, z = sample[instance]
        if x != first_x or y != first_y or z != first_z:
            return True
    return False
