"""Which of several barometers, or compasses, to use: pure, one sample of every instance at a time.

The first instance is used until it fails, then the next; what it differed by is added, so that the
change is no step. An instance fails

    no data    silent for half a second while another one delivers
    stuck      the same to the last digit for half a second while another one changes
    off        it has left the others, and it, not they, has left what the estimate expects

The difference between instances says that one of them is wrong, the estimate which one: what it
expects is compared with each over the last seconds only, so that a slow error of either does not
count. Instances that leave each other without one of them leaving the estimate are in dispute: an
alarm, and nothing is given up. Failed instances stay so until a restart.
"""

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Final

from uav_firmware.modules.sensors.triad_vote import Failed

Vector = tuple[float, ...]

_SILENT_US: Final = 500_000
_STUCK_US: Final = 500_000
_APART_US: Final = 300_000  # What is apart for less is a motor that draws current, a gust
_DISPUTED_US: Final = 3_000_000
_FAST_S: Final = 0.25  # Averages the noise of a sample
_SLOW_S: Final = 10.0  # What an instance is off by is known after that
_LONGEST_S: Final = 0.2


class _Instance:
    """What is remembered of one instance."""

    def __init__(self) -> None:
        self.value: Vector | None = None  # The last sample
        self.seen_us = 0  # When it came
        self.changed_us = 0  # When it last differed from the one before
        self.standing: list[float] | None = None  # What it is off the reference by, usually
        self.off: list[float] = []  # And by how much more just now


class SlowVote:
    """The instances of one kind of sensor; `limit` is how far they may leave each other."""

    def __init__(self, count: int, limit: float) -> None:
        self.limit = limit
        self.failed = 0  # [-] Bit 0 is the first instance
        self.good = list(range(count))  # Instances that have not failed
        self.disputed = False
        self.selected = 0
        self._apart_since_us: int | None = None
        self._instances = [_Instance() for _ in range(count)]
        self._correction: Vector | None = None
        self._last_us: int | None = None

    def update(
        self, now_us: int, samples: Sequence[Vector | None], reference: Vector | None
    ) -> list[Failed]:
        """Add the new samples of every instance; return what has failed by them.

        `reference` is what the estimate expects of a perfect instance, None while it expects
        nothing.
        """
        last_us, self._last_us = self._last_us, now_us
        dt = 0.0 if last_us is None else min((now_us - last_us) * 1e-6, _LONGEST_S)
        fresh = True
        for instance, sample in zip(self._instances, samples, strict=True):
            if sample is None or not math.isfinite(sum(sample)):
                fresh = False
                continue
            instance.seen_us = now_us
            if sample != instance.value:
                instance.value, instance.changed_us = sample, now_us
            else:
                fresh = False
        # The usual case: each has a new value, so that none is silent or stuck
        failures = [] if fresh else self._silent_or_stuck(self.good)
        if reference is not None:
            fast, slow = dt / (dt + _FAST_S), dt / (dt + _SLOW_S)
            for number in self.good:
                _track(self._instances[number], reference, fast, slow)
        if not failures:
            failures = self._compare(now_us, self.good)
        for failure in failures:
            self._give_up(failure.instance)
        return failures

    def use(self, samples: Sequence[Vector | None]) -> Vector | None:
        """The sample to use, of those that have come just now."""
        sample = samples[self.selected]
        if sample is None or self._correction is None:
            return sample
        return tuple(a + b for a, b in zip(sample, self._correction, strict=True))

    def _silent_or_stuck(self, good: list[int]) -> list[Failed]:
        seen_us = max(self._instances[i].seen_us for i in good) if good else 0
        changed_us = max(self._instances[i].changed_us for i in good) if good else 0
        failures = []
        for number in good:
            instance = self._instances[number]
            if seen_us - instance.seen_us > _SILENT_US:
                failures.append(Failed(number, "no data"))
            elif changed_us - instance.changed_us > _STUCK_US:
                failures.append(Failed(number, "stuck"))
        return failures

    def _compare(self, now_us: int, good: list[int]) -> list[Failed]:
        """Whether an instance has left the others and the estimate."""
        known = [i for i in good if self._instances[i].standing is not None]
        if len(known) < 2:
            self.disputed = False
            return []
        offs = [self._instances[i].off for i in known]
        widest = max([math.dist(one, other) for one, other in combinations(offs, 2)])
        if widest <= self.limit:
            self._apart_since_us, self.disputed = None, False
            return []
        if self._apart_since_us is None:
            self._apart_since_us = now_us
        apart_us = now_us - self._apart_since_us
        if apart_us < _APART_US:
            return []
        size = {i: math.hypot(*off) for i, off in zip(known, offs, strict=True)}
        worst = max(known, key=lambda i: size[i])
        others = max(size[i] for i in known if i != worst)
        if size[worst] > 2.0 * others:
            return [Failed(worst, "off")]
        self.disputed = apart_us >= _DISPUTED_US
        return []

    def _give_up(self, number: int) -> None:
        self.failed |= 1 << number
        good = self.good = [i for i in self.good if i != number]
        if number != self.selected or not good:
            return
        old, new = self._instances[number], self._instances[good[0]]
        self.selected = good[0]
        before = self._correction
        if old.standing is not None and new.standing is not None:
            step = tuple(a - b for a, b in zip(old.standing, new.standing, strict=True))
            self._correction = (
                step if before is None else tuple(map(sum, zip(before, step, strict=True)))
            )


def _track(instance: _Instance, reference: Vector, fast: float, slow: float) -> None:
    """Follow what an instance is off the reference by: quickly, and what is usual slowly.

    `fast` and `slow` are the shares of a new sample.
    """
    value, standing = instance.value, instance.standing
    if value is None:
        return
    if standing is None:
        instance.standing = [a - b for a, b in zip(value, reference, strict=True)]
        instance.off = [0.0] * len(value)
        return
    off = instance.off
    for axis, number in enumerate(value):
        old, usual = off[axis], standing[axis]
        off[axis] = excess = old + fast * (number - reference[axis] - usual - old)
        standing[axis] = usual + slow * excess
