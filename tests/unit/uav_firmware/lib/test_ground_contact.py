"""Whether a vehicle that is commanded to descend does not sink."""

import math

import pytest

from uav_firmware.lib.ground_contact import does_not_sink


@pytest.mark.parametrize("speed", [0.34, 0.0, -0.34])
def test_less_than_half_of_the_commanded_speed_is_no_descent(speed: float) -> None:
    assert does_not_sink(speed, 0.7, 0.0)
    assert not does_not_sink(math.copysign(0.36, speed), 0.7, 0.0)


@pytest.mark.parametrize("commanded", [0.1, 0.0, -1.0, math.nan])
def test_without_a_commanded_descent_nothing_follows(commanded: float) -> None:
    assert not does_not_sink(0.0, commanded, 0.5)


def test_an_uncertain_speed_within_three_deviations_is_none() -> None:
    assert does_not_sink(0.44, 0.7, 0.15)
    assert not does_not_sink(0.46, 0.7, 0.15)


def test_however_uncertain_more_than_1_m_s_is_a_descent() -> None:
    assert does_not_sink(0.99, 0.7, 2.0)
    assert not does_not_sink(1.01, 0.7, 2.0)


def test_a_limit_counts_where_the_speed_is_known_well() -> None:
    assert not does_not_sink(0.3, math.inf, 0.0, still_max_m_s=0.25)
    assert does_not_sink(0.3, math.inf, 0.15, still_max_m_s=0.25)
