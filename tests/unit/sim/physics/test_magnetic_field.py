"""The Earth's field against what NOAA's calculator and geography say."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.physics.magnetic_field import decimal_year, field_ned_gauss

MID_2026 = 2026.5


def declination_deg(latitude_deg: float, longitude_deg: float) -> float:
    north, east, _ = field_ned_gauss(latitude_deg, longitude_deg, 0.0, MID_2026)
    return math.degrees(math.atan2(east, north))


def test_the_needle_at_the_farm_points_where_the_model_says() -> None:
    north, east, down = field_ned_gauss(40.4434, -3.7382, 650.0, MID_2026)
    assert (north, east, down) == pytest.approx((0.257578, 0.002731, 0.370230), abs=1e-6)


def test_the_needle_dips_into_the_ground_in_the_north_and_out_of_it_in_the_south() -> None:
    assert field_ned_gauss(50.0, 10.0, 0.0, MID_2026)[2] > 0.4
    assert field_ned_gauss(-37.8, -58.3, 0.0, MID_2026)[2] < -0.1


@pytest.mark.parametrize(
    ("latitude_deg", "longitude_deg", "east"),
    [(69.6, 19.0, True), (-16.9, 180.0, True), (-37.8, -58.3, False), (40.7, -74.0, False)],
)
def test_declination_has_the_sign_of_the_charts(
    latitude_deg: float, longitude_deg: float, *, east: bool
) -> None:
    assert (declination_deg(latitude_deg, longitude_deg) > 0.0) is east


def test_both_sides_of_the_date_line_agree() -> None:
    assert field_ned_gauss(-16.9, 180.0, 60.0, MID_2026) == pytest.approx(
        field_ned_gauss(-16.9, -180.0, 60.0, MID_2026)
    )


@given(
    latitude_deg=st.floats(-89.9, 89.9),
    longitude_deg=st.floats(-180.0, 180.0),
    altitude_m=st.floats(-400.0, 6000.0),
    year=st.floats(2025.0, 2030.0),
)
def test_the_field_is_as_strong_as_the_earths_everywhere(
    latitude_deg: float, longitude_deg: float, altitude_m: float, year: float
) -> None:
    strength = math.hypot(*field_ned_gauss(latitude_deg, longitude_deg, altitude_m, year))
    assert 0.21 < strength < 0.68  # From the South Atlantic anomaly to the poles


@given(latitude_deg=st.floats(-80.0, 80.0), longitude_deg=st.floats(-180.0, 180.0))
def test_the_field_weakens_with_height(latitude_deg: float, longitude_deg: float) -> None:
    low, high = (
        math.hypot(*field_ned_gauss(latitude_deg, longitude_deg, height_m, MID_2026))
        for height_m in (0.0, 6000.0)
    )
    assert high < low


def test_the_year_follows_the_clock_and_stays_within_the_model() -> None:
    assert decimal_year(1_780_300_800_000_000) == pytest.approx(2026.4146, abs=1e-4)
    assert decimal_year(0) == 2025.0
    assert decimal_year(4_102_444_800_000_000) == 2030.0
