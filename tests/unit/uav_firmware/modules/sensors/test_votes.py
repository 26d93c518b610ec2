"""The votes over instances: what never reaches the output, and what counts as failed."""

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from uav_firmware.modules.sensors.slow_vote import SlowVote
from uav_firmware.modules.sensors.triad_vote import WINDOW, DisputeByBias, Limits, TriadVote

Array: TypeAlias = NDArray[np.float64]
Spoil: TypeAlias = Callable[[Array], Array]
NAN = math.nan
WINDOW_S = WINDOW / 125.0  # Every other sample of 250 Hz
LIMITS = Limits(bias=0.4, scale=0.02, usual=9.8, standing=0.15)
ANY = st.floats(-1e6, 1e6) | st.sampled_from([NAN, math.inf, -math.inf])
SANE = st.floats(-50.0, 50.0)


@given(
    good=st.tuples(*[st.tuples(SANE, SANE, SANE)] * 2),
    bad=st.tuples(ANY, ANY, ANY),
    place=st.integers(0, 2),
)
def test_no_failure_of_one_of_three_leaves_the_range_of_the_other_two(
    good: tuple[tuple[float, float, float], ...],
    bad: tuple[float, float, float],
    place: int,
) -> None:
    vectors = list(good)
    vectors.insert(place, bad)
    chosen = TriadVote(3, LIMITS).select(vectors)
    for value, one, two in zip(chosen, *good, strict=True):
        assert min(one, two) - 1e-9 <= value <= max(one, two) + 1e-9


def window_of(samples: Array) -> list[list[tuple[float, float, float]]]:
    """Samples of shape (WINDOW, instances, 3) as the vote takes them."""
    return [[(x, y, z) for x, y, z in sample] for sample in samples.tolist()]


class Flown:
    """Instances of an accelerometer in vibration, window by window."""

    def __init__(self, count: int, seed: int = 1, vibration: float = 0.4) -> None:
        self.vote = TriadVote(count, LIMITS)
        self.failed: list[tuple[int, str]] = []
        self._random = np.random.default_rng(seed)
        self._standing = 0.04 * self._random.standard_normal((count, 3))
        self._count, self._vibration = count, vibration
        self.spoil: Spoil = lambda window: window

    def fly(self, seconds: float) -> None:
        for _ in range(round(seconds / WINDOW_S)):
            motion = np.array([0.5, -0.2, -9.8]) + self._random.standard_normal((WINDOW, 1, 3))
            noise = self._random.standard_normal((WINDOW, self._count, 3))
            window = self.spoil(motion + self._standing + self._vibration * noise)
            news = self.vote.judge(window_of(window), window_of(motion))
            self.failed += [(failure.instance, failure.reason) for failure in news]


def shifted(instance: int, *shift: float) -> Spoil:
    def spoil(window: Array) -> Array:
        window[:, instance] += shift
        return window

    return spoil


@pytest.mark.first_case
@pytest.mark.parametrize("vibration", [0.1, 0.4, 1.3])
@pytest.mark.parametrize("count", [2, 3])
def test_ten_minutes_of_honest_noise_fail_nothing(count: int, vibration: float) -> None:
    flown = Flown(count, vibration=vibration)
    flown.fly(600.0)
    assert flown.failed == []
    assert flown.vote.dispute is None


@pytest.mark.parametrize("instance", [0, 1, 2])
@pytest.mark.parametrize("shift", [(0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (-1.0, 3.0, 2.0)])
def test_a_bias_is_found_within_a_second_and_its_instance_alone(
    instance: int, shift: tuple[float, float, float]
) -> None:
    flown = Flown(3)
    flown.fly(10.0)
    flown.spoil = shifted(instance, *shift)
    flown.fly(1.0)
    assert flown.failed == [(instance, "biased")]
    flown.fly(60.0)
    assert len(flown.failed) == 1
    assert flown.vote.failed == 1 << instance


@pytest.mark.parametrize(("count", "agree"), [(1, False), (2, True), (3, True)])
def test_several_agree_until_one_of_them_is_off(count: int, *, agree: bool) -> None:
    flown = Flown(count)
    flown.fly(10.0)
    assert flown.vote.agree is agree
    flown.spoil = shifted(0, 3.0, 0.0, 0.0)
    flown.fly(1.0)
    assert not flown.vote.agree


def test_a_bias_from_the_start_is_not_learnt_away() -> None:
    flown = Flown(3)
    flown.spoil = shifted(2, 0.0, 0.9, 0.0)
    flown.fly(30.0)
    assert flown.failed == [(2, "biased")]


@pytest.mark.parametrize(("value", "reason"), [(NAN, "no data"), (0.3, "stuck")])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_what_delivers_nothing_or_the_same_is_found_in_one_window(
    count: int, value: float, reason: str
) -> None:
    flown = Flown(count)
    flown.fly(5.0)

    def spoil(window: Array) -> Array:
        window[:, 0] = value
        return window

    flown.spoil = spoil
    flown.fly(WINDOW_S)
    assert flown.failed == [(0, reason)]
    chosen = flown.vote.select([(value, value, value), (1.0, 2.0, 3.0), (1.0, 2.0, 3.0)][:count])
    assert chosen == (1.0, 2.0, 3.0) if count > 1 else all(map(math.isnan, chosen))


def test_all_that_stand_still_together_are_not_stuck() -> None:
    vote = TriadVote(3, LIMITS)
    assert vote.judge([[(1.0, 1.0, 1.0)] * 3] * WINDOW, [[(1.0, 1.0, 1.0)] * 3] * WINDOW) == []


def test_a_glitch_of_the_bus_fails_nothing() -> None:
    flown = Flown(3)

    def spoil(window: Array) -> Array:
        window[7, 1] = NAN
        return window

    flown.spoil = spoil
    flown.fly(5.0)
    assert flown.failed == []


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_gap_of_all_instances_fails_them_only_when_it_lasts(count: int) -> None:
    """A bus that resets takes a twentieth of a second; there is nothing to use instead."""
    flown = Flown(count)

    def gap(window: Array) -> Array:
        window[-8:] = NAN
        return window

    flown.spoil = gap
    flown.fly(1.0)
    assert flown.failed == []
    flown.spoil = lambda window: np.full_like(window, NAN)
    flown.fly(WINDOW_S)
    assert flown.failed == [(number, "no data") for number in range(count)]


@pytest.mark.parametrize("wrong", [0, 1])
def test_of_two_the_one_whose_side_the_estimators_bias_takes_is_wrong(wrong: int) -> None:
    flown = Flown(2)
    flown.fly(10.0)
    flown.spoil = shifted(wrong, 2.0, 0.0, 0.0)
    flown.fly(2 * WINDOW_S)
    assert flown.vote.dispute is not None
    flown.fly(3 * WINDOW_S)
    apart = flown.vote.dispute
    assert apart is not None
    assert apart[0] == pytest.approx(2.0 if wrong == 0 else -2.0, rel=0.4)
    dispute = DisputeByBias()
    for number in range(10):
        assert dispute.update(None, (0.02, 0.0, 0.0), number * 200_000) is None
    assert dispute.update(apart, (0.1, 0.0, 0.0), 2_000_000) is None
    # The mean is off by half of the error, whichever of the two makes it
    failed = dispute.update(apart, (1.02, 0.0, 0.0), 2_200_000)
    assert failed is not None
    assert failed.which == wrong
    assert failed.shift_frd[0] == pytest.approx(-1.0)


class Slow:
    """Two barometers, or compasses, at 50 Hz."""

    def __init__(self, limit: float = 1.0) -> None:
        self.vote = SlowVote(2, limit)
        self.failed: list[tuple[int, str]] = []
        self.used: list[float] = []
        self._random = np.random.default_rng(1)
        self._now_us = 0

    def run(self, seconds: float, first: float | None = 0.0, second: float | None = 4.0) -> None:
        for _ in range(round(seconds * 50)):
            self._now_us += 20_000
            noise = 0.1 * self._random.standard_normal(3)
            # The truth climbs; the estimate follows it
            height = self._now_us * 1e-6
            samples = [
                None if off is None else (height + off + float(n),)
                for off, n in zip((first, second), noise, strict=False)
            ]
            news = self.vote.update(self._now_us, samples, (height + 0.3 * float(noise[2]),))
            self.failed += [(failure.instance, failure.reason) for failure in news]
            used = self.vote.use(samples)
            if used is not None:
                self.used.append(used[0] - height)


def test_a_silent_barometer_is_replaced_without_a_step() -> None:
    slow = Slow()
    slow.run(30.0)
    slow.run(1.0, first=None)
    assert slow.failed == [(0, "no data")]
    slow.run(5.0, first=None)
    assert np.mean(slow.used[-100:]) == pytest.approx(0.0, abs=0.15)


@pytest.mark.parametrize(("first", "second", "wrong"), [(3.0, 4.0, 0), (0.0, 1.5, 1)])
def test_of_two_that_part_the_one_that_leaves_the_estimate_fails(
    first: float, second: float, wrong: int
) -> None:
    slow = Slow()
    slow.run(30.0)
    slow.run(3.0, first, second)
    assert slow.failed == [(wrong, "off")]
    assert np.mean(slow.used[-50:]) == pytest.approx(0.0, abs=0.3)


def test_what_leaves_the_estimate_together_is_no_instances_failure() -> None:
    slow = Slow()
    slow.run(30.0)
    slow.run(10.0, 5.0, 9.0)
    assert slow.failed == []


def test_a_frozen_compass_fails_while_the_other_changes() -> None:
    vote, failed = SlowVote(2, 0.05), []
    for number in range(100):
        field = (0.3 + 1e-4 * math.sin(number), 0.0, 0.4)
        news = vote.update(number * 20_000, [(0.3, 0.0, 0.4), field], None)
        failed += [(failure.instance, failure.reason) for failure in news]
    assert failed == [(0, "stuck")]
    assert vote.selected == 1
