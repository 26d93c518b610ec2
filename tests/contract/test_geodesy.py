"""Four geodesies that share no formula: the firmware's, the simulator's, the farm's, the tests'."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.geodesy import LocalPlane
from sim.physics.earth import degrees_per_metre
from tests.support.geodesy import LocalGround
from uav_firmware.lib.geo import LocalFrame

latitudes = st.floats(-80.0, 80.0)
longitudes = st.floats(-179.0, 179.0)
metres = st.floats(-500.0, 500.0)


def test_north_and_east_are_where_latitude_and_longitude_grow() -> None:
    ground = LocalGround(40.0, -3.0, 650.0)
    assert ground.north_east_m(40.001, -3.0)[0] > 0.0
    assert ground.north_east_m(40.0, -2.999)[1] > 0.0


def test_a_minute_of_latitude_is_a_nautical_mile_or_nearly() -> None:
    north, east = LocalGround(45.0, 10.0).north_east_m(45.0 + 1.0 / 60.0, 10.0)
    assert north == pytest.approx(1852.2, abs=0.5)
    assert east == pytest.approx(0.0, abs=1e-6)


@given(latitudes, longitudes, metres, metres)
def test_a_place_is_where_it_was_put(
    latitude: float, longitude: float, north: float, east: float
) -> None:
    ground = LocalGround(latitude, longitude, 650.0)
    assert ground.north_east_m(*ground.place(north, east)) == pytest.approx((north, east), abs=1e-6)


@given(latitudes, longitudes, metres, metres)
def test_the_firmware_agrees(latitude: float, longitude: float, north: float, east: float) -> None:
    there = LocalGround(latitude, longitude, 650.0).place(north, east)
    firmware = LocalFrame(latitude, longitude, 650.0).to_ned(*there, 650.0)
    assert firmware[:2] == pytest.approx((north, east), abs=1e-4)


@given(st.floats(-70.0, 70.0), longitudes, metres, metres)
def test_the_plane_of_fields_and_flights_agrees_to_centimetres(
    latitude: float, longitude: float, north: float, east: float
) -> None:
    there = LocalGround(latitude, longitude).place(north, east)
    plane = LocalPlane.at(latitude, longitude)
    assert plane.to_plane(*there) == pytest.approx((north, east), abs=0.15)
    assert plane.to_globe(*plane.to_plane(*there)) == pytest.approx(there, abs=1e-9)


@given(latitudes, longitudes)
def test_the_simulator_agrees(latitude: float, longitude: float) -> None:
    ground = LocalGround(latitude, longitude, 650.0)
    metre = degrees_per_metre(latitude, 650.0)
    north, east = ground.north_east_m(latitude + metre.north, longitude + metre.east)
    assert math.hypot(north - 1.0, east - 1.0) < 1e-5
