"""Which items are a geofence, and which are rally points."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.toy_vehicle import NAN, at, item, waypoint
from tests.unit.uav_firmware.modules.navigator.geofence.test_geofence import SQUARE, polygon
from uav_firmware.lib.fence_rules import check_fence, check_rally_points
from uav_firmware.msg.mission import MissionItem, MissionResult


@pytest.mark.parametrize(
    ("items", "result"),
    [
        (polygon(5001, *SQUARE[:2], count=2.0), MissionResult.INVALID_PARAM1),
        (polygon(5001, *SQUARE, count=5.0), MissionResult.INVALID_PARAM1),
        (polygon(5001, *SQUARE, count=3.5), MissionResult.INVALID_PARAM1),
        (polygon(5001, (0, 0), (5, 5), (10, 10), count=3.0), MissionResult.INVALID),
        ([item(0, 5003, frame=3, param1=0.0, **at(0, 0))], MissionResult.INVALID_PARAM1),
        ([item(0, 5003, frame=3, param1=NAN, **at(0, 0))], MissionResult.INVALID_PARAM1),
        (
            [item(0, 5004, frame=3, param1=9.0, param2=1.0, **at(0, 0))],
            MissionResult.INVALID_PARAM2,
        ),
        ([item(0, 5003, frame=3, param1=9.0, x=91.0)], MissionResult.INVALID_PARAM5_X),
        ([item(0, 5003, frame=2, param1=9.0, **at(0, 0))], MissionResult.UNSUPPORTED_FRAME),
        ([waypoint(0, 1, 1)], MissionResult.UNSUPPORTED),
        (
            [item(seq, 5000, frame=3, **at(0, 0)) for seq in range(2)],
            MissionResult.INVALID,
        ),
    ],
)
def test_what_is_no_fence_is_refused(items: list[MissionItem], result: MissionResult) -> None:
    rejection = check_fence(items)
    assert rejection is not None
    assert rejection.result == result


@pytest.mark.parametrize(
    "corners",
    [
        [(-10.0, -10.0), (10.0, 10.0), (10.0, -10.0), (-10.0, 10.0)],  # A bow tie
        [(0.0, 0.0), (0.0, 40.0), (40.0, 40.0), (40.0, 0.0), (20.0, 60.0)],
        [(0.0, 0.0), (0.0, 40.0), (0.0, 20.0), (40.0, 20.0)],  # Folds back on itself
        [(0.0, 0.0), (0.0, 40.0), (20.0, 20.0), (40.0, 40.0), (40.0, 0.0), (20.0, 20.0)],  # Touches
        [(0.0, 0.0), (0.0, 0.0), (0.0, 40.0), (40.0, 0.0)],
    ],
)
@pytest.mark.parametrize("command", [5001, 5002])
def test_a_polygon_that_crosses_or_touches_itself_is_refused(
    command: int, corners: list[tuple[float, float]]
) -> None:
    circle = item(0, 5003, frame=3, param1=50.0, **at(0.0, 0.0))
    items = [circle, *polygon(command, *corners, count=float(len(corners)))]
    items = [one._replace(seq=seq) for seq, one in enumerate(items)]
    rejection = check_fence(items)
    assert rejection is not None
    assert rejection.result == MissionResult.INVALID
    assert rejection.seq >= 1


@given(
    st.lists(st.floats(20.0, 400.0), min_size=3, max_size=60),
    st.floats(0.0, 6.0),
    st.booleans(),
)
def test_a_star_shaped_polygon_is_a_fence_however_jagged(
    radii: list[float], turn: float, backwards: bool
) -> None:
    """Every corner in its own direction from one point: such a polygon never crosses itself."""
    step = -math.tau / len(radii) if backwards else math.tau / len(radii)
    corners = [
        (radius * math.cos(turn + step * k), radius * math.sin(turn + step * k))
        for k, radius in enumerate(radii)
    ]
    assert check_fence(polygon(5001, *corners, count=float(len(corners)))) is None


def test_polygons_circles_and_a_return_point_are_a_fence() -> None:
    items = [
        *polygon(5001, *SQUARE),
        *polygon(5002, (1, 1), (1, 5), (5, 5), count=3.0),
        item(7, 5003, frame=3, param1=9.0, **at(0, 0)),
        item(8, 5004, frame=0, param1=9.0, **at(0, 0)),
        item(9, 5000, frame=3, **at(0, 0)),
    ]
    assert check_fence(items) is None
    assert check_fence([]) is None


@pytest.mark.parametrize(
    ("fields", "result"),
    [
        ({"param1": 3.0}, MissionResult.INVALID_PARAM1),
        ({"z": NAN}, MissionResult.INVALID_PARAM7),
        ({"x": NAN}, MissionResult.INVALID_PARAM5_X),
    ],
)
def test_what_is_no_rally_point_is_refused(fields: dict[str, float], result: MissionResult) -> None:
    rejection = check_rally_points([item(0, 5100, **{"frame": 3, **at(1, 1), **fields})])
    assert rejection is not None
    assert rejection.result == result
