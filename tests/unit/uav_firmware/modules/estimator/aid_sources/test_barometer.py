import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.modules.estimator.aid_sources.barometer import LowPass

values = st.floats(-1e3, 1e3)


def test_first_sample_passes_unchanged() -> None:
    assert LowPass(1.0).update(7.0, 0.01) == 7.0


def test_a_step_is_63_percent_done_after_one_time_constant() -> None:
    low_pass = LowPass(1.0, 0.0)
    steps = 1000
    for _ in range(steps):
        low_pass.update(1.0, 1.0 / (math.tau * steps))
    assert low_pass.value == pytest.approx(1.0 - math.exp(-1.0), abs=1e-9)


@given(values, values, st.floats(0.01, 100.0), st.floats(1e-4, 10.0))
def test_output_lies_between_state_and_input(
    state: float, sample: float, cutoff_hz: float, dt: float
) -> None:
    output = LowPass(cutoff_hz, state).update(sample, dt)
    assert min(state, sample) - 1e-9 <= output <= max(state, sample) + 1e-9


@given(values, values, st.floats(0.01, 10.0), st.floats(1e-3, 1.0))
def test_one_long_step_is_two_short_ones(
    state: float, sample: float, cutoff_hz: float, dt: float
) -> None:
    long, short = LowPass(cutoff_hz, state), LowPass(cutoff_hz, state)
    short.update(sample, 0.5 * dt)
    assert short.update(sample, 0.5 * dt) == pytest.approx(long.update(sample, dt), abs=1e-6)


def test_no_cutoff_passes_all() -> None:
    assert LowPass(0.0, 5.0).update(1.0, 0.004) == 1.0
