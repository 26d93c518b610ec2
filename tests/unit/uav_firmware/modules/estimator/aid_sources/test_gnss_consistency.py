"""A receiver whose position does not move as its velocity says."""

import math

import numpy as np
import pytest

from uav_firmware.modules.estimator.aid_sources.gnss_consistency import GpsConsistency

FIX_S = 0.1
START_S = 5.0
END_S = 15.0


def contradictions(
    *, bias_m_s: float = 0.0, drift_m_s: float = 0.0, jump_m: float = 0.0, gap: int = 1
) -> list[float]:
    """When a receiver on a vehicle that circles contradicts itself [s]."""
    check, random, seen = GpsConsistency(), np.random.default_rng(1), []
    for number in range(0, 300, gap):
        t = FIX_S * number
        lies = START_S <= t < END_S
        north = 8.0 * math.sin(0.5 * t) + 0.15 * float(random.standard_normal())
        east = -8.0 * math.cos(0.5 * t) + 0.15 * float(random.standard_normal())
        if lies:
            north += jump_m + drift_m_s * (t - START_S)
        velocity = (4.0 * math.cos(0.5 * t) + lies * bias_m_s, 4.0 * math.sin(0.5 * t))
        check.update(round(t * 1e6), (north, east), velocity)
        if check.contradicts:
            seen.append(t)
    return seen


@pytest.mark.parametrize("size_m_s", [-1.0, 1.0, 3.0])
@pytest.mark.parametrize("drifts", [False, True])
def test_a_velocity_that_is_not_that_of_the_position_is_found_and_ends(
    size_m_s: float, *, drifts: bool
) -> None:
    seen = contradictions(drift_m_s=size_m_s) if drifts else contradictions(bias_m_s=size_m_s)
    assert seen
    assert START_S < seen[0] < START_S + 3.0
    assert all(time in np.array(seen) for time in (9.0, 12.0))
    assert seen[-1] < END_S + 3.2 or drifts


@pytest.mark.parametrize("jump_m", [0.0, 0.5, 20.0])
def test_an_honest_receiver_and_one_that_jumps_do_not_contradict_themselves(
    jump_m: float,
) -> None:
    assert not contradictions(jump_m=jump_m)


def test_what_comes_too_seldom_is_not_compared() -> None:
    assert not contradictions(bias_m_s=3.0, gap=6)
