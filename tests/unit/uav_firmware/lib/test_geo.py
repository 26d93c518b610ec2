import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.geo import LocalFrame, distance_and_bearing, gravity_m_s2
from uav_firmware.msg.vectors import Vector3

HOME = LocalFrame(40.4434, -3.7382, 650.0)
latitudes = st.floats(-80.0, 80.0)
longitudes = st.floats(-180.0, 180.0)
offsets = st.floats(-10_000.0, 10_000.0)
heights = st.floats(-300.0, 3000.0)


def vincenty(from_deg: tuple[float, float], to_deg: tuple[float, float]) -> tuple[float, float]:
    """Distance and bearing after Vincenty 1975, the independent witness of these tests."""
    a, f = 6378137.0, 1.0 / 298.257223563
    b = a * (1.0 - f)
    u1, u2 = (math.atan((1.0 - f) * math.tan(math.radians(p[0]))) for p in (from_deg, to_deg))
    span = math.radians(to_deg[1] - from_deg[1])
    longitude = span
    for _ in range(50):
        east = math.cos(u2) * math.sin(longitude)
        north = math.cos(u1) * math.sin(u2) - math.sin(u1) * math.cos(u2) * math.cos(longitude)
        sin_s = math.hypot(east, north)
        cos_s = math.sin(u1) * math.sin(u2) + math.cos(u1) * math.cos(u2) * math.cos(longitude)
        sigma = math.atan2(sin_s, cos_s)
        sin_a = math.cos(u1) * math.cos(u2) * math.sin(longitude) / sin_s
        cos2_a = 1.0 - sin_a * sin_a
        mid = cos_s - 2.0 * math.sin(u1) * math.sin(u2) / max(cos2_a, 1e-12)  # equator: 0 / 0 is 0
        c = f / 16.0 * cos2_a * (4.0 + f * (4.0 - 3.0 * cos2_a))
        inner = mid + c * cos_s * (2.0 * mid * mid - 1.0)
        longitude = span + (1.0 - c) * f * sin_a * (sigma + c * sin_s * inner)
    k = cos2_a * (a * a - b * b) / (b * b)
    big_a = 1.0 + k / 16384.0 * (4096.0 + k * (-768.0 + k * (320.0 - 175.0 * k)))
    big_b = k / 1024.0 * (256.0 + k * (-128.0 + k * (74.0 - 47.0 * k)))
    delta = big_b * sin_s * (mid + big_b / 4.0 * cos_s * (2.0 * mid * mid - 1.0))
    return b * big_a * (sigma - delta), math.atan2(east, north)


@pytest.mark.parametrize(
    ("step_deg", "axis", "sign"),
    [((0.001, 0.0), 0, 1), ((-0.001, 0.0), 0, -1), ((0.0, 0.001), 1, 1), ((0.0, -0.001), 1, -1)],
)
def test_compass_directions(step_deg: tuple[float, float], axis: int, sign: int) -> None:
    ned = HOME.to_ned(40.4434 + step_deg[0], -3.7382 + step_deg[1], 650.0)
    assert ned[axis] * sign > 80.0
    assert abs(ned[1 - axis]) < 0.01


def test_higher_is_negative_down() -> None:
    assert HOME.to_ned(40.4434, -3.7382, 660.0)[2] == pytest.approx(-10.0)


@given(latitudes, longitudes, heights, offsets, offsets, st.floats(-500.0, 500.0))
def test_positions_come_back_within_a_tenth_of_a_millimetre(
    latitude: float, longitude: float, altitude: float, north: float, east: float, down: float
) -> None:
    frame = LocalFrame(latitude, longitude, altitude)
    back = frame.to_ned(*frame.to_geodetic((north, east, down)))
    assert back == pytest.approx((north, east, down), abs=1e-4)


@given(offsets, offsets, st.floats(-500.0, 500.0))
def test_altitude_is_origin_altitude_minus_down_however_far(n: float, e: float, d: float) -> None:
    assert HOME.to_geodetic((n, e, d))[2] == pytest.approx(650.0 - d, abs=1e-9)


@given(latitudes, longitudes, st.floats(-0.05, 0.05), st.floats(-0.05, 0.05))
def test_local_coordinates_measure_the_ellipsoid(
    latitude: float, longitude: float, dlat: float, dlon: float
) -> None:
    if math.hypot(dlat, dlon) < 1e-5:
        return
    there = (latitude + dlat, longitude + dlon)
    n, e, _ = LocalFrame(latitude, longitude, 0.0).to_ned(*there, 0.0)
    distance, bearing = vincenty((latitude, longitude), there)
    assert math.hypot(n, e) == pytest.approx(distance, abs=0.01)
    assert math.remainder(math.atan2(e, n) - bearing, math.tau) == pytest.approx(0.0, abs=1e-5)


@given(st.floats(-70.0, 70.0), longitudes, st.floats(-0.15, 0.15), st.floats(-0.15, 0.15))
def test_distance_and_bearing_agree_with_vincenty(
    latitude: float, longitude: float, dlat: float, dlon: float
) -> None:
    if math.hypot(dlat, dlon) < 1e-5:
        return
    there = (latitude + dlat, longitude + dlon)
    expected = vincenty((latitude, longitude), there)
    distance, bearing = distance_and_bearing(latitude, longitude, *there)
    assert distance == pytest.approx(expected[0], abs=1e-3)
    assert math.remainder(bearing - expected[1], math.tau) * distance == pytest.approx(
        0.0, abs=1e-3
    )


def test_distance_across_the_date_line_is_short() -> None:
    distance, bearing = distance_and_bearing(10.0, 179.999, 10.0, -179.999)
    assert distance == pytest.approx(219.3, abs=1.0)
    assert bearing == pytest.approx(math.pi / 2, abs=1e-3)


def test_a_point_has_no_distance_from_itself() -> None:
    assert distance_and_bearing(40.0, -3.0, 40.0, -3.0) == (0.0, 0.0)


def test_ten_metres_north_of_a_pole_free_origin_is_ten_metres_on_the_ellipsoid() -> None:
    latitude, longitude, _ = HOME.to_geodetic((10.0, 0.0, 0.0))
    distance, bearing = distance_and_bearing(40.4434, -3.7382, latitude, longitude)
    # 650 m up, a metre covers 650 / 6.4e6 less of the ellipsoid.
    assert distance == pytest.approx(10.0 * (1.0 - 650.0 / 6.38e6), abs=1e-5)
    assert bearing == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("latitude_deg", "altitude_m", "gravity"),
    [(0.0, 0.0, 9.780325), (90.0, 0.0, 9.832185), (45.0, 0.0, 9.806199), (45.0, 1000.0, 9.80311)],
)
def test_normal_gravity(latitude_deg: float, altitude_m: float, gravity: float) -> None:
    assert gravity_m_s2(latitude_deg, altitude_m) == pytest.approx(gravity, abs=1e-4)


def test_vectors_of_a_frame_are_plain_floats() -> None:
    ned: Vector3 = HOME.to_ned(40.4435, -3.7382, 651.0)
    assert all(type(component) is float for component in ned)
