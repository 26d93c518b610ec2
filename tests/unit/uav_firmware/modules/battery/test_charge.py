"""The charge by voltage and current, against a pack of known charge made up here."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.modules.battery.charge import ChargeEstimator, Pack

PACK = Pack(4, 3.6, 4.05, 0.005, 5.2)
PERIOD_US = 100_000


def feed(
    estimator: ChargeEstimator,
    seconds: float,
    voltage_v: float,
    current_a: float,
    start_s: float = 0.0,
) -> float:
    """Steady samples, ten a second; gives the time of the last one [s]."""
    first = round(start_s * 1e6)
    for index in range(round(seconds * 10)):
        estimator.update(first + index * PERIOD_US, voltage_v, current_a)
    return start_s + seconds


@pytest.mark.parametrize(
    ("cell_v", "charge"),
    [(4.2, 1.0), (4.05, 1.0), (3.825, 0.5), (3.69, 0.2), (3.6, 0.0), (3.3, 0.0)],
)
def test_a_resting_pack_is_known_by_its_voltage(cell_v: float, charge: float) -> None:
    estimator = ChargeEstimator(PACK)
    feed(estimator, 60.0, 4 * cell_v, 0.0)
    assert estimator.remaining == pytest.approx(charge, abs=0.01)


def test_a_load_does_not_look_like_an_empty_pack() -> None:
    estimator = ChargeEstimator(PACK)
    resting_v, current_a = 4 * 3.825, 40.0
    feed(estimator, 1.0, resting_v - current_a * 4 * 0.005, current_a)
    assert estimator.remaining == pytest.approx(0.5, abs=0.01)


def test_a_full_pack_is_counted_down_by_its_current() -> None:
    estimator = ChargeEstimator(PACK)
    now_s = feed(estimator, 5.0, 16.8, 0.0)
    feed(estimator, 360.0, 16.8, 10.4, now_s)  # 1.04 Ah at a voltage that never falls
    assert estimator.consumed_ah == pytest.approx(1.04, rel=0.01)
    assert estimator.remaining == pytest.approx(0.8, abs=0.01)


def test_a_pack_has_no_more_than_its_current_has_left() -> None:
    """Its voltage stays that of a pack at 90 %, which would raise the estimate."""
    estimator = ChargeEstimator(PACK)
    current_a = 10.4
    feed(estimator, 900.0, 4 * (4.005 - current_a * 0.005), current_a)  # 2.6 of 5.2 Ah
    assert estimator.remaining == pytest.approx(0.5, abs=0.01)


def test_a_pack_older_than_its_label_is_known_by_its_voltage_in_the_end() -> None:
    estimator = ChargeEstimator(PACK)
    now_s = feed(estimator, 5.0, 16.8, 0.0)
    for step in range(600):  # Half of the capacity is gone: empty after half of the charge
        cell_v = 4.2 - 0.6 * step / 600.0
        now_s = feed(estimator, 1.5, 4 * (cell_v - 0.05), 10.0, now_s)
    assert estimator.consumed_ah == pytest.approx(2.5, rel=0.02)
    assert estimator.remaining < 0.1


def test_half_a_pack_put_in_is_half_a_pack() -> None:
    estimator = ChargeEstimator(PACK)
    feed(estimator, 1.0, 4 * 3.825, 0.5)
    assert estimator.remaining == pytest.approx(0.5, abs=0.01)


def test_a_collapsed_voltage_is_an_empty_pack_within_twelve_seconds() -> None:
    estimator = ChargeEstimator(PACK)
    now_s = feed(estimator, 10.0, 16.6, 11.0)
    feed(estimator, 12.0, 4 * 3.45, 11.0, now_s)
    assert estimator.remaining < 0.05


def test_a_dip_of_half_a_second_is_not() -> None:
    estimator = ChargeEstimator(PACK)
    now_s = feed(estimator, 10.0, 16.0, 11.0)
    before = estimator.remaining
    now_s = feed(estimator, 0.5, 13.5, 11.0, now_s)
    feed(estimator, 3.0, 16.0, 11.0, now_s)
    assert estimator.remaining == pytest.approx(before, abs=0.1)


def test_without_a_known_capacity_voltage_alone_tells() -> None:
    estimator = ChargeEstimator(PACK._replace(capacity_ah=-1e-3))
    now_s = feed(estimator, 10.0, 4 * 3.825, 0.0)
    feed(estimator, 30.0, 4 * 3.69, 0.0, now_s)
    assert estimator.remaining == pytest.approx(0.2, abs=0.01)


def test_no_pack_has_no_charge_and_a_new_one_is_taken_as_it_comes() -> None:
    estimator = ChargeEstimator(PACK)
    now_s = feed(estimator, 5.0, 4 * 3.69, 0.0)
    now_s = feed(estimator, 1.0, 0.0, 0.0, now_s)
    assert estimator.remaining == 0.0
    feed(estimator, 1.0, 16.8, 0.0, now_s)
    assert estimator.remaining == pytest.approx(1.0, abs=0.01)


@given(
    st.lists(st.tuples(st.floats(), st.floats(), st.integers(-1_000_000, 10_000_000)), max_size=60)
)
def test_no_sample_makes_a_charge_that_is_none(samples: list[tuple[float, float, int]]) -> None:
    estimator = ChargeEstimator(PACK)
    now_us = 0
    for voltage_v, current_a, step_us in samples:
        now_us += step_us
        estimator.update(now_us, voltage_v, max(min(current_a, 1e3), -1e3))
        assert 0.0 <= estimator.remaining <= 1.0
        assert math.isfinite(estimator.consumed_ah)
