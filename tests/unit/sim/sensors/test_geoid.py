"""Height of the geoid, against places where it is known from elsewhere."""

import pytest

from sim.sensors.geoid import geoid_height_m


@pytest.mark.parametrize(
    ("latitude_deg", "longitude_deg", "height_m"),
    [
        (47.3977, 8.5456, 47.2),  # Zurich, home of PX4's simulation: 488.0 m AMSL, 535.3 m
        (40.4434, -3.7382, 51.5),  # Madrid, EGM96
        (5.0, 78.0, -104.0),  # The low south of India
        (-5.5, 140.0, 74.0),  # The high of New Guinea
        (90.0, 12.0, 13.6),
    ],
)
def test_known_heights_are_met_within_the_grids_error(
    latitude_deg: float, longitude_deg: float, height_m: float
) -> None:
    assert geoid_height_m(latitude_deg, longitude_deg) == pytest.approx(height_m, abs=9.0)


@pytest.mark.parametrize("latitude_deg", [-90.0, -16.855, 0.0, 89.999, 90.0])
def test_there_is_no_step_at_the_date_line(latitude_deg: float) -> None:
    west, east = (geoid_height_m(latitude_deg, longitude) for longitude in (-180.0, 179.9999))
    assert west == pytest.approx(east, abs=0.01)
    assert geoid_height_m(latitude_deg, 180.0) == west
