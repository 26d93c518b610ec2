"""Ways and circles against polygons: the law against thousands of sampled points."""

import math
import random
from collections.abc import Sequence

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from afarcloud.area import TOLERANCE_M, Area, Plane
from afarcloud.geodesy import shifted
from afarcloud.plan import Geofence
from tests.support.polygons import Metres, clearance_m

HERE = (40.4434, -3.7382)
SURE_M = 3.0 * TOLERANCE_M
SAMPLES = 100
few = settings(max_examples=60)
metres = st.tuples(st.floats(-200.0, 200.0), st.floats(-200.0, 200.0))
origins = st.sampled_from([HERE, (0.0, 0.0), (69.65, 18.96), (-33.9, 179.9999), (84.0, -180.0)])


def place(origin: tuple[float, float], east_m: float, north_m: float) -> tuple[float, float]:
    """A place some metres away; each axis by itself, as on the law's plane."""
    latitude = shifted(*origin, 0.0 if north_m >= 0.0 else 180.0, abs(north_m))[0]
    longitude = shifted(*origin, 90.0 if east_m >= 0.0 else 270.0, abs(east_m))[1]
    return latitude, longitude


def star(seed: int, corners: int, middle: Metres = (0.0, 0.0)) -> list[Metres]:
    """A polygon of any shape that does not cross itself."""
    dice = random.Random(seed)
    angles = sorted(dice.uniform(0.0, math.tau) for _ in range(corners))
    radii = [dice.uniform(20.0, 150.0) for _ in angles]
    return [
        (middle[0] + r * math.sin(a), middle[1] + r * math.cos(a))
        for a, r in zip(angles, radii, strict=True)
    ]


polygons = st.builds(star, st.integers(0, 10**9), st.integers(3, 16), metres)


def fence(
    origin: tuple[float, float],
    inclusion: Sequence[Sequence[Metres]] = (),
    exclusion: Sequence[Sequence[Metres]] = (),
) -> Area:
    def outlines(shapes: Sequence[Sequence[Metres]]) -> tuple[tuple[Metres, ...], ...]:
        return tuple(tuple(place(origin, *corner) for corner in shape) for shape in shapes)

    return Area(Geofence(inclusion=outlines(inclusion), exclusion=outlines(exclusion)))


def along(start: Metres, end: Metres, number: int = SAMPLES) -> list[Metres]:
    return [
        (start[0] + (end[0] - start[0]) * k / number, start[1] + (end[1] - start[1]) * k / number)
        for k in range(number + 1)
    ]


@few
@given(
    origin=origins,
    inclusion=st.lists(polygons, max_size=2),
    exclusion=st.lists(polygons, max_size=2),
    start=metres,
    end=metres,
)
def test_a_way_is_forbidden_just_when_a_point_on_it_is(
    origin: tuple[float, float],
    inclusion: list[list[Metres]],
    exclusion: list[list[Metres]],
    start: Metres,
    end: Metres,
) -> None:
    clearance = clearance_m(along(start, end), inclusion, exclusion)
    between_m = math.dist(start, end) / SAMPLES / 2.0  # A distance changes no faster than a place
    assume(clearance < -SURE_M or clearance > between_m + SURE_M)
    area = fence(origin, inclusion, exclusion)
    fault = area.fault_on_leg(place(origin, *start), place(origin, *end))
    if clearance < 0.0:
        assert fault is not None
    elif len(inclusion) < 2:  # Between two areas the samples know no gap
        assert fault is None


@few
@given(origin=origins, inclusion=polygons, exclusion=polygons, point=metres)
def test_a_place_is_forbidden_just_when_it_lies_outside_or_in_an_exclusion(
    origin: tuple[float, float], inclusion: list[Metres], exclusion: list[Metres], point: Metres
) -> None:
    clearance = clearance_m([point], [inclusion], [exclusion])
    assume(abs(clearance) > SURE_M)
    fault = fence(origin, [inclusion], [exclusion]).fault_at(place(origin, *point))
    assert (fault is not None) == (clearance < 0.0)


@pytest.mark.thorough
@few
@given(inclusion=polygons, exclusion=polygons, centre=metres, radius_m=st.floats(5.0, 150.0))
def test_a_circle_is_forbidden_just_when_a_point_of_its_line_is(
    inclusion: list[Metres], exclusion: list[Metres], centre: Metres, radius_m: float
) -> None:
    ring = [
        (centre[0] + radius_m * math.cos(k / 32), centre[1] + radius_m * math.sin(k / 32))
        for k in range(202)
    ]
    clearance = clearance_m(ring, [inclusion], [exclusion])
    assume(clearance < -SURE_M or clearance > radius_m / 64.0 + SURE_M)
    area = fence(HERE, [inclusion], [exclusion])
    fault = area.fault_on_circle(place(HERE, *centre), radius_m)
    assert (fault is not None) == (clearance < 0.0)


SQUARE = [(-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0)]
NOTCHED = [(-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (0.0, -10.0), (-50.0, 50.0)]


@pytest.mark.parametrize("shape", [SQUARE, SQUARE[::-1]], ids=["left", "right"])
def test_the_outline_itself_is_allowed_on_both_sides(shape: list[Metres]) -> None:
    corners = [place(HERE, *corner) for corner in shape]
    inside, outside = fence(HERE, inclusion=[shape]), fence(HERE, exclusion=[shape])
    for area in (inside, outside):
        for start, end in zip(corners, [*corners[1:], corners[0]], strict=True):
            assert area.fault_at(start) is None
            assert area.fault_on_leg(start, end) is None


@pytest.mark.parametrize(("beyond_m", "allowed"), [(0.05, True), (0.5, False)])
def test_a_way_beside_the_outline_is_allowed_within_the_tolerance(
    beyond_m: float, allowed: bool
) -> None:
    start, end = place(HERE, 50.0 + beyond_m, -40.0), place(HERE, 50.0 + beyond_m, 40.0)
    fault = fence(HERE, inclusion=[SQUARE]).fault_on_leg(start, end)
    assert (fault is None) == allowed


def test_a_way_between_two_allowed_places_may_lead_through_a_notch() -> None:
    area = fence(HERE, inclusion=[NOTCHED])
    start, end = place(HERE, -45.0, 30.0), place(HERE, 45.0, 30.0)
    assert area.fault_at(start) is None is area.fault_at(end)
    assert area.fault_on_leg(start, end) == "leaves geofence.inclusion"


def test_two_areas_that_touch_are_one() -> None:
    east = [(x + 100.0, y) for x, y in SQUARE]
    area = fence(HERE, inclusion=[SQUARE, east])
    assert area.fault_on_leg(place(HERE, -40.0, 0.0), place(HERE, 140.0, 0.0)) is None


def test_a_circle_round_an_exclusion_is_allowed() -> None:
    area = fence(HERE, exclusion=[SQUARE])
    assert area.fault_on_circle(HERE, 75.0) is None
    assert area.fault_on_circle(HERE, 60.0) == "enters geofence.exclusion.0"


def test_the_second_exclusion_is_named() -> None:
    north = [(x, y + 300.0) for x, y in SQUARE]
    area = fence(HERE, exclusion=[SQUARE, north])
    way = place(HERE, -100.0, 300.0), place(HERE, 100.0, 300.0)
    assert area.fault_on_leg(*way) == "enters geofence.exclusion.1"
    assert area.fault_at(place(HERE, 0.0, 310.0)) == "lies in geofence.exclusion.1"


def test_how_far_outside_a_place_lies_is_told() -> None:
    fault = fence(HERE, inclusion=[SQUARE]).fault_at(place(HERE, 80.0, 0.0))
    assert fault == "lies 30.0 m outside geofence.inclusion"


def test_a_way_round_the_globe_is_no_way_through_a_fence_on_the_other_side() -> None:
    area = fence((0.0, 0.0), exclusion=[SQUARE])
    assert area.fault_on_leg((0.0, 179.999), (0.0, -179.999)) is None


def test_a_polygon_without_height_holds_nothing() -> None:
    line = [(-50.0, 0.0), (0.0, 0.0), (50.0, 0.0)]
    area = fence(HERE, inclusion=[line])
    assert area.fault_at(place(HERE, 10.0, 5.0)) is not None


@pytest.mark.parametrize("latitude", [0.0, 45.0, 80.0, -89.0])
def test_metres_east_are_metres_at_every_latitude(latitude: float) -> None:
    to_east = shifted(latitude, 10.0, 90.0, 100.0)
    assert Plane(latitude, 10.0).point(*to_east) == pytest.approx((100.0, 0.0), abs=0.05)


def test_a_long_survey_in_a_fence_of_many_corners_takes_no_more_looks_than_it_has_to() -> None:
    """Each way looks at the edges near it, not at all of them."""
    shape = [
        (150.0 * math.sin(k * math.tau / 1000), 150.0 * math.cos(k * math.tau / 1000))
        for k in range(1000)
    ]
    area = fence(HERE, inclusion=[shape])
    polygon = area.inclusion[0]
    short = area.plane.leg(place(HERE, 0.0, 0.0), place(HERE, 50.0, 0.0))
    assert polygon.edges_near(short) == []
    rim = area.plane.leg(place(HERE, 140.0, 0.0), place(HERE, 160.0, 0.0))
    assert 0 < len(polygon.edges_near(rim)) < 50
