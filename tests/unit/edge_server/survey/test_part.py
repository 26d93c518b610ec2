"""The area of a survey is a part of its field."""

import pytest

from afarcloud.plan import Polygon
from edge_server.survey import part
from tests.unit.edge_server.survey.fields import place

U_SHAPE = tuple(
    place(*corner)
    for corner in [(0, 0), (90, 0), (90, 60), (60, 60), (60, 30), (30, 30), (30, 60), (0, 60)]
)


def area(*corners: tuple[float, float]) -> Polygon:
    return tuple(place(*corner) for corner in corners)


def paths(ring: Polygon) -> list[str]:
    return [fault.path for fault in part.faults(ring, U_SHAPE)]


@pytest.mark.parametrize(
    "ring",
    [
        U_SHAPE,
        U_SHAPE[::-1],
        area((5, 5), (85, 5), (85, 25), (5, 25)),
        # A corner on an edge of the field, as it is rounded
        area((0, 0), (45, -0.01), (90, 0), (90, 30), (0, 30)),
    ],
)
def test_a_part_of_the_field(ring: Polygon) -> None:
    assert paths(ring) == []


@pytest.mark.parametrize(
    ("ring", "path", "text"),
    [
        (area((5, 5), (85, -3), (85, 25)), "area.1", "is 3 m outside of the field"),
        (area((5, 5), (85, -0.4), (85, 25)), "area.1", "is 0.4 m outside of the field"),
        (
            area((5, 5), (85, 5), (85, 50), (5, 50)),
            "area.2",
            "is followed by a side that is 15 m outside of the field",
        ),
    ],
)
def test_an_area_that_leaves_the_field_is_refused_by_corner(
    ring: Polygon, path: str, text: str
) -> None:
    (fault,) = part.faults(ring, U_SHAPE)
    assert (fault.path, fault.message) == (path, text)


def test_a_side_across_a_bay_is_found_without_a_corner_outside() -> None:
    assert paths(area((5, 20), (85, 20), (85, 45), (65, 25), (25, 25), (5, 45))) == []
    assert paths(area((5, 40), (85, 40), (85, 45), (5, 45))) == ["area.0", "area.2"]


def test_rings_far_from_the_area_do_not_count() -> None:
    near, far = area((20, 5), (30, 5), (30, 15)), area((70, 45), (80, 45), (80, 55))
    assert part.touching(area((0, 0), (40, 0), (40, 20), (0, 20)), [near, far]) == (near,)


def test_a_bay_whose_mouth_lies_on_a_side_of_the_area_is_not_covered() -> None:
    """The neighbour's land behind a gap of 3 m in an edge that is straight otherwise."""
    field = area(
        (0, 0), (40, 0), (40, 5), (25, 5), (25, 55), (75, 55), (75, 5), (43, 5), (43, 0),
        (100, 0), (100, 100), (0, 100),
    )  # fmt: skip
    around = area((0, 0), (100, 0), (100, 80), (0, 80))
    texts = [fault.message for fault in part.faults(around, field)]
    assert texts == ["surrounds ground that is outside of the field"]


def comb(teeth: int, *, is_lying: bool = False) -> Polygon:
    """A field of long teeth side by side, or a part of it whose teeth lie across them."""
    corners = [(0.0, 0.0)]
    for number in range(teeth):
        at = 1000.0 * number / teeth
        width = 400.0 / teeth
        corners += [(at, 1000.0), (at + width, 1000.0), (at + width, 50.0), (at + 2 * width, 50.0)]
    corners.append((1000.0, 0.0))
    if is_lying:
        last = 1000.0 * (teeth - 1) / teeth
        corners = [(x / 1e3 * last + 0.1, 100.0 + 0.8 * y) for y, x in corners]
    return area(*corners)


def test_an_area_across_every_tooth_of_a_field_is_refused_before_it_is_looked_at_whole() -> None:
    """Its sides cross the boundary a hundred thousand times: to look at each takes minutes."""
    (fault,) = part.faults(comb(240, is_lying=True), comb(240))
    assert fault.path == "area"
    assert fault.message == "crosses the boundary of the field too often; draw a simpler one"
    few = list(part.faults(comb(8, is_lying=True), comb(8)))
    assert len(few) > 8
    assert all("outside of the field" in fault.message for fault in few)
