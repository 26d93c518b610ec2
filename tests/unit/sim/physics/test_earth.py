"""The simulator's Earth against published figures."""

import pytest

from sim.physics.earth import degrees_per_metre, wrapped_longitude_deg


@pytest.mark.parametrize(
    ("latitude_deg", "north_m", "east_m"),
    # Length of a degree on WGS-84: Osborne, The Mercator Projections (2013), table 5.1
    [(0.0, 110_574.0, 111_320.0), (45.0, 111_132.0, 78_847.0), (60.0, 111_412.0, 55_800.0)],
)
def test_a_degree_is_as_long_as_the_tables_say(
    latitude_deg: float, north_m: float, east_m: float
) -> None:
    metre = degrees_per_metre(latitude_deg, 0.0)
    assert 1.0 / metre.north == pytest.approx(north_m, rel=3e-4)
    assert 1.0 / metre.east == pytest.approx(east_m, rel=3e-4)


def test_a_degree_is_longer_higher_up() -> None:
    assert degrees_per_metre(40.0, 1000.0).north < degrees_per_metre(40.0, 0.0).north
    assert degrees_per_metre(40.0, 1000.0).east < degrees_per_metre(40.0, 0.0).east


@pytest.mark.parametrize(
    ("longitude_deg", "expected_deg"),
    [(0.0, 0.0), (180.0, 180.0), (180.001, -179.999), (-180.001, 179.999), (-3.7, -3.7)],
)
def test_a_step_over_the_date_line_ends_on_its_other_side(
    longitude_deg: float, expected_deg: float
) -> None:
    assert wrapped_longitude_deg(longitude_deg) == pytest.approx(expected_deg, abs=1e-9)
