"""Declination by place: sign, the date line, and what a chart says."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.modules.estimator.declination import declination


@pytest.mark.parametrize(
    ("latitude_deg", "longitude_deg", "expected_deg"),
    # World Magnetic Model 2025, mid 2026
    [
        (40.4434, -3.7382, 0.6),
        (-37.764, -58.296, -8.2),
        (-16.855, 179.9999, 12.7),
        (69.649, 18.955, 11.2),
    ],
)
def test_declination_is_that_of_the_model(
    latitude_deg: float, longitude_deg: float, expected_deg: float
) -> None:
    assert math.degrees(declination(latitude_deg, longitude_deg)) == pytest.approx(
        expected_deg, abs=0.5
    )


@given(latitude_deg=st.floats(-90.0, 90.0))
def test_both_sides_of_the_date_line_agree(latitude_deg: float) -> None:
    assert declination(latitude_deg, 180.0) == pytest.approx(declination(latitude_deg, -180.0))


@given(latitude_deg=st.floats(-60.0, 60.0), longitude_deg=st.floats(-180.0, 180.0))
def test_a_hundred_metres_change_little(latitude_deg: float, longitude_deg: float) -> None:
    here = declination(latitude_deg, longitude_deg)
    there = declination(latitude_deg + 0.001, longitude_deg + 0.001)
    assert math.degrees(abs(there - here)) < 0.05


@given(latitude_deg=st.floats(-90.0, 90.0), longitude_deg=st.floats(-540.0, 540.0))
def test_there_is_an_angle_everywhere(latitude_deg: float, longitude_deg: float) -> None:
    assert -math.pi <= declination(latitude_deg, longitude_deg) <= math.pi
