"""The simulator's Earth against published figures."""

import math

import pytest

from sim.earth import MAGNETIC_FIELD_NED_GAUSS, degrees_per_metre


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


def test_the_needle_points_north_and_dips_into_the_ground() -> None:
    north, east, down = MAGNETIC_FIELD_NED_GAUSS
    assert math.degrees(math.atan2(east, north)) == pytest.approx(0.607, abs=0.002)
    assert math.degrees(math.atan2(down, math.hypot(north, east))) == pytest.approx(
        55.171, abs=0.002
    )
    assert math.hypot(north, east, down) == pytest.approx(0.451026, abs=1e-5)
