"""The sun against almanacs and the sky."""

from datetime import UTC, datetime

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sim.world.sun import ENOUGH_DEG, day_shift_s, illuminance_lx, solar_hour, sun

FARM = (40.4434, -3.7382)


def utc_s(text: str) -> float:
    return datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()


def test_in_the_morning_it_stands_in_the_east_at_noon_in_the_south_then_in_the_west() -> None:
    places = [sun(*FARM, utc_s(f"2026-06-01T{hour}:00")) for hour in ("07", "12", "18")]
    assert places[0].azimuth_deg == pytest.approx(80.0, abs=10.0)
    assert places[1].azimuth_deg == pytest.approx(175.0, abs=10.0)
    assert places[2].azimuth_deg == pytest.approx(285.0, abs=10.0)
    assert places[1].elevation_deg > max(places[0].elevation_deg, places[2].elevation_deg) > 0.0


def test_south_of_the_tropics_noon_is_in_the_north() -> None:
    place = sun(-37.764, -58.296, utc_s("2026-06-21T15:55"))
    assert min(place.azimuth_deg, 360.0 - place.azimuth_deg) < 5.0


@pytest.mark.parametrize(
    ("day", "declination_deg"),
    # The sun's declination at the solstices and equinoxes of 2026 (definition of the seasons)
    [("2026-03-20", 0.0), ("2026-06-21", 23.44), ("2026-09-23", 0.0), ("2026-12-21", -23.44)],
)
def test_its_height_at_noon_is_that_of_the_season(day: str, declination_deg: float) -> None:
    start = utc_s(day)
    highest = max(sun(*FARM, start + 60.0 * i).elevation_deg for i in range(1440))
    assert highest == pytest.approx(90.0 - FARM[0] + declination_deg, abs=0.25)


def test_noon_of_solar_time_is_when_it_culminates() -> None:
    start = utc_s("2026-04-15")  # When the equation of time is nil
    noon = max(range(1440), key=lambda i: sun(*FARM, start + 60.0 * i).elevation_deg)
    assert solar_hour(FARM[1], start + 60.0 * noon) == pytest.approx(12.0, abs=0.05)


@given(st.floats(-90.0, 89.0), st.floats(0.01, 1.0))
@example(1e-320, 1.0)
def test_a_higher_sun_is_never_darker(elevation_deg: float, more_deg: float) -> None:
    assert illuminance_lx(elevation_deg + more_deg) >= illuminance_lx(elevation_deg)


def test_daylight_has_the_figures_of_the_books() -> None:
    assert 95_000.0 < illuminance_lx(60.0) < 130_000.0  # Full daylight
    assert 300.0 < illuminance_lx(0.0) < 1_000.0  # Sunset
    assert illuminance_lx(-18.0) < 1.0  # Night


@given(st.integers(0, 366 * 48), st.sampled_from([FARM, (-37.8, -58.3), (0.0, 37.1)]))
def test_a_flight_begins_by_day_whatever_the_hour(
    half_hours: int, place: tuple[float, float]
) -> None:
    start = utc_s("2026-01-01") + 1800.0 * half_hours
    shift_s = day_shift_s(*place, start)
    assert abs(shift_s) <= 12.0 * 3600.0
    assert sun(*place, start + shift_s).elevation_deg >= ENOUGH_DEG


@pytest.mark.parametrize("start", ["2026-11-21T20:36", "2026-01-10T04:10", "2026-06-20T02:40"])
def test_vehicles_that_start_one_after_the_other_at_night_share_the_farms_time(start: str) -> None:
    first_s, second_s = utc_s(start), utc_s(start) + 40.0
    assert day_shift_s(*FARM, first_s) == day_shift_s(*FARM, second_s) != 0.0


def test_by_day_the_farm_keeps_the_vehicles_time() -> None:
    assert day_shift_s(*FARM, utc_s("2026-06-01T08:00")) == 0.0
    assert day_shift_s(*FARM, utc_s("2026-11-21T17:02")) != 0.0
