"""The firmware's declination against the simulator's field: neither knows the other's numbers."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.physics.magnetic_field import field_ned_gauss
from sim.physics.worlds import WORLDS
from uav_firmware.modules.estimator.declination import declination


def error_deg(latitude_deg: float, longitude_deg: float, altitude_m: float) -> float:
    north, east, _ = field_ned_gauss(latitude_deg, longitude_deg, altitude_m, 2026.5)
    turn = declination(latitude_deg, longitude_deg) - math.atan2(east, north)
    return abs((math.degrees(turn) + 180.0) % 360.0 - 180.0)


@pytest.mark.parametrize("name", sorted(WORLDS))
def test_the_compass_is_read_right_at_every_world(name: str) -> None:
    world = WORLDS[name]
    assert error_deg(world.latitude_deg, world.longitude_deg, world.altitude_amsl_m) < 0.5


@given(latitude_deg=st.floats(-45.0, 60.0), longitude_deg=st.floats(-180.0, 180.0))
def test_the_compass_is_read_right_to_two_degrees_where_farms_are(
    latitude_deg: float, longitude_deg: float
) -> None:
    assert error_deg(latitude_deg, longitude_deg, 500.0) < 2.1
