from hypothesis import given
from hypothesis import strategies as st

from afarcloud import geometry

SQUARE = [(40.0, -3.0), (40.001, -3.0), (40.001, -2.999), (40.0, -2.999)]
"""About 111 m north to south and 85 m west to east."""


def test_the_middle_is_inside_and_the_neighbours_are_outside() -> None:
    assert geometry.contains(SQUARE, (40.0005, -2.9995))
    for point in ((40.0005, -3.0001), (40.0005, -2.9989), (39.9999, -2.9995), (40.0011, -2.9995)):
        assert not geometry.contains(SQUARE, point)


def test_a_polygon_across_the_date_line_is_one_polygon() -> None:
    fiji = [(-17.0, 179.9), (-17.0, -179.9), (-16.9, -179.9), (-16.9, 179.9)]
    assert geometry.contains(fiji, (-16.95, 179.95))
    assert geometry.contains(fiji, (-16.95, -179.95))
    assert not geometry.contains(fiji, (-16.95, 179.8))


@given(st.floats(0.05, 0.95), st.floats(0.05, 0.95), st.booleans(), st.integers(0, 3))
def test_direction_and_start_of_the_outline_do_not_matter(
    north: float, east: float, reverse: bool, start: int
) -> None:
    polygon = SQUARE[start:] + SQUARE[:start]
    if reverse:
        polygon.reverse()
    assert geometry.contains(polygon, (40.0 + north * 1e-3, -3.0 + east * 1e-3))
