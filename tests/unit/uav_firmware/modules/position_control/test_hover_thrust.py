import pytest

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.modules.position_control.hover_thrust import (
    HIGHEST,
    LOWEST,
    HoverThrustEstimator,
    HoverThrustNoise,
)

NOISE = HoverThrustNoise(initial=0.05, walk=0.0036, acceleration=2.0, gate=3.0)
DT = 0.016


def learn(estimator: HoverThrustEstimator, true_hover: float, seconds: float) -> None:
    """Hover with a true hover thrust that the estimator does not know."""
    for step in range(round(seconds / DT)):
        thrust = true_hover * (1.02 if step // 30 % 2 else 0.98)
        estimator.update(thrust, STANDARD_GRAVITY_M_S2 * (thrust / true_hover - 1.0), DT)


def test_a_vehicle_that_needs_more_thrust_is_heavier_than_believed() -> None:
    estimator = HoverThrustEstimator(0.25, NOISE)
    assert estimator.update(0.3, 0.0, DT) > 0.25


def test_a_vehicle_that_rises_is_lighter_than_believed() -> None:
    estimator = HoverThrustEstimator(0.25, NOISE)
    assert estimator.update(0.25, 1.0, DT) < 0.25


@pytest.mark.parametrize("true_hover", [0.18, 0.25, 0.32])
def test_the_true_hover_thrust_is_learnt(true_hover: float) -> None:
    estimator = HoverThrustEstimator(0.25, NOISE)
    learn(estimator, true_hover, 10.0)
    assert estimator.hover == pytest.approx(true_hover, rel=0.02)


def test_a_shock_is_no_weight() -> None:
    estimator = HoverThrustEstimator(0.25, NOISE)
    learn(estimator, 0.25, 10.0)
    assert estimator.update(0.25, 60.0, DT) == pytest.approx(0.25, rel=0.01)


def test_the_estimate_stays_within_reason() -> None:
    for acceleration in (-9.0, 9.0):
        estimator = HoverThrustEstimator(0.25, NOISE._replace(gate=10.0))
        for _ in range(5000):
            estimator.update(0.25, acceleration, DT)
        assert LOWEST <= estimator.hover <= HIGHEST


def test_reset_begins_again_from_the_parameter() -> None:
    estimator = HoverThrustEstimator(0.25, NOISE)
    learn(estimator, 0.32, 10.0)
    estimator.reset(0.25, NOISE)
    assert estimator.hover == 0.25
    learn(estimator, 0.32, 10.0)
    assert estimator.hover == pytest.approx(0.32, rel=0.02)


@pytest.mark.parametrize("believed", [0.1, 0.15, 0.5, 0.8])
def test_a_parameter_that_is_far_off_is_corrected_within_seconds(believed: float) -> None:
    estimator = HoverThrustEstimator(believed, NOISE)
    assert not estimator.learnt
    learn(estimator, 0.225, 5.0)
    assert estimator.hover == pytest.approx(0.225, rel=0.05)
    assert estimator.learnt


def test_a_load_that_is_dropped_is_learnt_anew() -> None:
    estimator = HoverThrustEstimator(0.4, NOISE)
    learn(estimator, 0.4, 10.0)
    learn(estimator, 0.2, 5.0)
    assert estimator.hover == pytest.approx(0.2, rel=0.05)
