"""What an outline must be like."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from afarcloud.faults import InvalidError
from edge_server.geodata.field import Field, area_m2, check
from tests.support.geodesy import LocalGround

HOME = (40.4434, -3.7382)


def place(east_m: float, north_m: float) -> tuple[float, float]:
    """A place so far from home."""
    return LocalGround(*HOME).place(north_m, east_m)


def ring(*corners: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    return tuple(place(*corner) for corner in corners)


def square(side_m: float, east_m: float = 0.0) -> tuple[tuple[float, float], ...]:
    low, high = -side_m / 2, side_m / 2
    return ring(
        (low + east_m, low), (high + east_m, low), (high + east_m, high), (low + east_m, high)
    )


def faults(field: Field) -> dict[str, str]:
    try:
        check(field)
    except InvalidError as error:
        return {fault.path: fault.message for fault in error.faults}
    return {}


@pytest.mark.thorough
@given(side_m=st.floats(2.0, 5000.0), turns=st.integers(0, 3), hole=st.floats(0.1, 0.9))
def test_a_square_with_a_hole_is_a_field(side_m: float, turns: int, hole: float) -> None:
    outer = square(side_m)
    assume(side_m * hole > 1.1)
    field = Field(boundary=outer[turns:] + outer[:turns], holes=(square(side_m * hole),))
    assert faults(field) == {}
    seen_m2, meant_m2 = area_m2(field), side_m**2 * (1 - hole**2)
    assert seen_m2 == pytest.approx(meant_m2, abs=0.002 * side_m**2)


@given(
    radii=st.lists(st.floats(10.0, 1000.0), min_size=3, max_size=40),
    first=st.integers(0, 39),
    second=st.integers(0, 39),
)
def test_a_star_shaped_ring_is_simple_and_with_two_corners_exchanged_it_often_is_not(
    radii: list[float], first: int, second: int
) -> None:
    count = len(radii)
    angles = [2 * math.pi * index / count for index in range(count)]
    corners = [(r * math.cos(a), r * math.sin(a)) for r, a in zip(radii, angles, strict=True)]
    assert faults(Field(boundary=ring(*corners))) == {}
    assume(count >= 4)
    first, second = first % count, second % count
    corners[first], corners[second] = corners[second], corners[first]
    found = faults(Field(boundary=ring(*corners)))
    assert bool(found) <= (first != second)


def test_a_bow_tie_crosses_itself_and_says_where() -> None:
    found = faults(Field(boundary=ring((0, 0), (10, 10), (10, 0), (0, 10))))
    assert found == {"boundary": "crosses itself: side 0 and side 2, counted from 0"}


@pytest.mark.parametrize(
    "corners", [((0, 0), (10, 0), (20, 0)), ((0, 0), (0, 0), (0, 0)), ((0, 0), (0.5, 0), (0, 0.5))]
)
def test_a_line_or_a_spot_is_no_field(corners: tuple[tuple[float, float], ...]) -> None:
    assert faults(Field(boundary=ring(*corners))) == {"boundary": "has no area"}


def test_a_hole_lies_in_the_field() -> None:
    outside = Field(boundary=square(10), holes=(square(2), square(4, east_m=50)))
    assert faults(outside) == {"holes.1": "lies outside of the boundary"}


def test_a_field_is_more_than_its_holes() -> None:
    assert faults(Field(boundary=square(100.0), holes=(square(100.0),))) == {
        "holes": "leave nothing of the field"
    }
    assert faults(Field(boundary=square(100.0), holes=(square(99.0),))) == {}


def test_a_corner_with_a_missing_sign_is_none_of_the_field() -> None:
    corners = ((40.443, -3.739), (40.444, -3.739), (40.444, 3.738), (40.443, -3.738))
    far = "corner 2 is 634 km from the first one of the field, at most 100 km"
    assert faults(Field(boundary=corners)) == {"boundary": far}
    hole = ((40.4434, -3.7387), (-40.4436, -3.7387), (40.4436, -3.7384))
    field = Field(boundary=square(1000.0), exclusions=(hole,))
    assert list(faults(field)) == ["exclusions.0"]
    assert faults(Field(boundary=square(70_000.0))) == {}


def test_an_exclusion_may_lie_across_the_edge() -> None:
    assert faults(Field(boundary=square(10), exclusions=(square(10, east_m=50),))) == {}


def test_a_field_on_the_date_line_is_small() -> None:
    field = Field(boundary=((10.0, 179.9995), (10.0, -179.9995), (10.001, -179.9995)))
    assert faults(field) == {}
    assert area_m2(field) == pytest.approx(0.5 * 111.3 * 109.6, rel=0.01)


def test_too_many_corners_are_refused_before_they_are_looked_at() -> None:
    circle = ring(
        *(
            (1000 * math.cos(index * math.tau / 1000), 1000 * math.sin(index * math.tau / 1000))
            for index in range(1000)
        )
    )
    assert "boundary" in faults(Field(boundary=circle, exclusions=(circle,) * 5))


def test_an_entry_lies_at_the_field() -> None:
    assert faults(Field(boundary=square(100), entry=place(0, 1500))) == {}
    found = faults(Field(boundary=square(100), entry=place(0, 3000)))
    assert list(found) == ["entry"]
