"""The wind blows where it is said to, and its gusts are as strong as the standard says."""

import statistics

import pytest

from sim.physics.noise import generators
from sim.physics.truth import Vector3
from sim.physics.wind import Wind, intensities_m_s, mean_wind_factor, scale_lengths_m

STEP_S = 0.05


def wind(
    *, seed: int = 1, speed_m_s: float = 8.0, from_deg: float = 0.0, gusts: bool = True
) -> Wind:
    return Wind(
        generators(seed)["wind"],
        speed_m_s=speed_m_s,
        from_deg=from_deg,
        gusts=gusts,
        step_s=STEP_S,
    )


def blow(air: Wind, *, seconds: float, height_m: float = 30.0) -> list[Vector3]:
    return [air.step(height_m, 8.0) for _ in range(round(seconds / STEP_S))]


@pytest.mark.parametrize(
    ("from_deg", "blows_to"),
    [(0.0, (-8, 0, 0)), (90.0, (0, -8, 0)), (180.0, (8, 0, 0)), (270.0, (0, 8, 0))],
)
def test_a_wind_is_named_after_where_it_comes_from(from_deg: float, blows_to: Vector3) -> None:
    air = wind(from_deg=from_deg, gusts=False)
    assert air.step(6.096, 8.0) == pytest.approx(blows_to, abs=1e-12)


@pytest.mark.parametrize(
    ("height_m", "factor"),
    # ln(h / 0.15 ft) / ln(20 / 0.15), below a foot as at a foot
    [(0.0, 0.388), (0.3048, 0.388), (0.9144, 0.612), (6.096, 1.0), (10.0, 1.101), (30.48, 1.329)],
)
def test_the_mean_wind_grows_with_height_as_the_standard_says(
    height_m: float, factor: float
) -> None:
    assert mean_wind_factor(height_m) == pytest.approx(factor, abs=0.001)
    air = wind(from_deg=180.0, gusts=False)
    assert air.step(height_m, 8.0)[0] == pytest.approx(8.0 * factor, abs=0.01)


def test_without_wind_there_are_no_gusts() -> None:
    air = wind(speed_m_s=0.0)
    assert set(blow(air, seconds=1.0)) == {(0.0, 0.0, 0.0)}


def test_gusts_fluctuate_about_the_mean_wind() -> None:
    gusty = blow(wind(from_deg=270.0), seconds=4000.0)
    north, east, down = (statistics.fmean(component) for component in zip(*gusty, strict=True))
    assert north == pytest.approx(0.0, abs=0.3)
    assert east == pytest.approx(8.0 * mean_wind_factor(30.0), abs=0.3)
    assert down == pytest.approx(0.0, abs=0.15)


@pytest.mark.thorough
def test_gusts_have_the_intensities_of_the_standard() -> None:
    height_m = 30.0
    gusty = blow(wind(from_deg=270.0), seconds=10_000.0, height_m=height_m)
    across, along, down = (statistics.stdev(component) for component in zip(*gusty, strict=True))
    horizontal, vertical = intensities_m_s(height_m, 8.0)
    assert along == pytest.approx(horizontal, rel=0.08)
    assert across == pytest.approx(horizontal, rel=0.08)
    assert down == pytest.approx(vertical, rel=0.08)


@pytest.mark.thorough
def test_a_gust_lasts_as_long_as_its_scale_length_takes_to_pass() -> None:
    height_m, airspeed_m_s = 30.0, 8.0
    gusty = blow(wind(from_deg=270.0), seconds=10_000.0, height_m=height_m)
    along = [east - 8.0 * mean_wind_factor(height_m) for _, east, _ in gusty]
    lag = round(scale_lengths_m(height_m)[0] / airspeed_m_s / STEP_S)
    variance = statistics.fmean(value * value for value in along)
    later = statistics.fmean(a * b for a, b in zip(along, along[lag:], strict=False))
    assert later / variance == pytest.approx(0.37, abs=0.08)  # 1/e


def test_intensities_at_a_thousand_feet_are_the_same_in_all_directions() -> None:
    horizontal, vertical = intensities_m_s(304.8, 10.0)
    assert vertical == pytest.approx(1.0)
    assert horizontal == pytest.approx(vertical, rel=1e-3)


def test_near_the_ground_gusts_are_short_and_mostly_horizontal() -> None:
    low, high = scale_lengths_m(5.0), scale_lengths_m(100.0)
    assert low[0] < high[0]
    assert low[1] < high[1]
    horizontal, vertical = intensities_m_s(5.0, 10.0)
    assert horizontal > 1.5 * vertical


def test_the_ground_itself_has_the_gusts_of_ten_feet() -> None:
    assert scale_lengths_m(-1.0) == scale_lengths_m(3.048)


def test_the_same_seed_blows_the_same() -> None:
    assert blow(wind(seed=5), seconds=1.0) == blow(wind(seed=5), seconds=1.0)
    assert blow(wind(seed=5), seconds=1.0) != blow(wind(seed=6), seconds=1.0)
