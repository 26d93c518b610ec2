"""`.plan` files: what is read of them and what is written."""

import contextlib
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud import geometry
from afarcloud.faults import InvalidError
from afarcloud.plan import Geofence, Mission
from afarcloud.wire import read_as
from edge_server.exchange import from_commands, qgc_plan
from edge_server.exchange.mission_item import Home
from tests.support.cases import failures
from tests.support.geodesy import LocalGround
from tests.unit.edge_server.exchange.missions import HOME, TAKEOFF, at, missions, plan_file


def survey(*items: Any, kind: str = "survey") -> dict[str, Any]:
    """A complex item as QGroundControl saves it, in part."""
    inside = {"version": 1, "CameraCalc": {}, "HoverAndCapture": False, "Items": list(items)}
    return {
        "type": "ComplexItem",
        "complexItemType": kind,
        "version": 5,
        "angle": 90,
        "polygon": [],
        "TransectStyleComplexItem": inside,
    }


def fenced(**fence: Any) -> dict[str, Any]:
    return plan_file(TAKEOFF) | {"geoFence": {"version": 2, "circles": [], "polygons": []} | fence}


def faults(document: Any) -> dict[str, str]:
    with pytest.raises(InvalidError) as refused:
        qgc_plan.read(document)
    return {fault.path: fault.message for fault in refused.value.faults}


def test_simple_items_are_read_with_their_place_in_the_file() -> None:
    file = qgc_plan.read(plan_file(TAKEOFF, at(16, 1, 2, 3, None)))
    assert [item.path for item in file.items] == ["mission.items.0", "mission.items.1"]
    assert list(file.items[1].parameters) == [1, 2, 3, None, 40.4435, -3.7382, 10]
    assert file.home == Home(*HOME, 650)
    assert file.speed_m_s == 5
    assert (file.geofence, file.warnings) == (None, ())


@pytest.mark.parametrize("kind", ["survey", "CorridorScan"])
def test_what_a_survey_expands_to_is_read_in_its_place(kind: str) -> None:
    file = qgc_plan.read(plan_file(TAKEOFF, survey(at(16), at(16), kind=kind), at(21)))
    assert [item.number for item in file.items] == [1, 2, 3, 4]
    assert file.items[2].path == "mission.items.1.TransectStyleComplexItem.Items.1"
    assert file.items[3].path == "mission.items.2"


INVALID: list[tuple[Any, str]] = [
    ([], "fileType"),
    (plan_file() | {"fileType": "GeoFence"}, "fileType"),
    (plan_file() | {"version": 2}, "version"),
    (plan_file() | {"mission": None}, "mission.version"),
    (plan_file(version=1), "mission.version"),
    (plan_file(items={}), "mission.items"),
    (plan_file(plannedHomePosition=[1, 2]), "mission.plannedHomePosition"),
    (plan_file(plannedHomePosition=[1, True, 3]), "mission.plannedHomePosition"),
    (plan_file(5), "mission.items.0.type"),  # type: ignore[arg-type]  # as files may be
    (plan_file(TAKEOFF, {"type": "Item"}), "mission.items.1.type"),
    (plan_file(survey(at(16), kind="StructureScan")), "mission.items.0"),
    (plan_file(survey(at(16), kind=[])), "mission.items.0"),  # type: ignore[arg-type]  # as above
    (plan_file(at(16, params=[10**400] * 7)), "mission.items.0"),
    (plan_file(plannedHomePosition=[10**400, 2, 3]), "mission.plannedHomePosition"),
    (plan_file(survey(5)), "mission.items.0.TransectStyleComplexItem.Items.0"),
    (plan_file(at(16) | {"command": "16"}), "mission.items.0"),
    (plan_file(at(16) | {"command": True}), "mission.items.0"),
    (plan_file(at(16, frame=-1)), "mission.items.0"),
    (plan_file(at(16, params=[0] * 6)), "mission.items.0"),
    (plan_file(at(16, params=[0] * 6 + ["x"])), "mission.items.0"),
    (plan_file(at(16, params=[0] * 6 + [math.inf])), "mission.items.0"),
    (fenced(version=3), "geoFence.version"),
    (fenced(version=True), "geoFence.version"),
    (plan_file(TAKEOFF) | {"geoFence": []}, "geoFence.version"),
    (fenced(polygons={}), "geoFence.polygons"),
    (fenced(polygons=[{"polygon": []}]), "geoFence.polygons.0.inclusion"),
    (fenced(polygons=[{"inclusion": True}]), "geoFence.polygons.0.polygon"),
    (fenced(circles=[{"inclusion": True}]), "geoFence.circles.0.circle"),
    (
        fenced(circles=[{"inclusion": True, "circle": {"center": [40, -3], "radius": -1}}]),
        "geoFence.circles.0.circle",
    ),
    (
        fenced(circles=[{"inclusion": True, "circle": {"center": [1, 2], "radius": 10**400}}]),
        "geoFence.circles.0.circle",
    ),
    (
        fenced(circles=[{"inclusion": True, "circle": {"center": [91, -3], "radius": 1}}]),
        "geoFence.circles.0.circle",
    ),
]


def check_invalid(document: Any, path: str) -> None:
    assert path in faults(document)


def test_an_invalid_plan_is_refused_with_its_path() -> None:
    assert failures(check_invalid, INVALID) == []


def test_a_complex_item_without_its_items_is_named() -> None:
    found = faults(plan_file(TAKEOFF, survey(at(16), kind="StructureScan")))
    assert found["mission.items.1"].startswith("item 2 (StructureScan) does not carry")


@pytest.mark.parametrize(
    "fence",
    [
        {},
        {"version": 1},
        {"version": 1, "polygon": [{"latitude": 1}], "parameters": []},
        {"polygons": [5], "circles": "none"},
    ],
)
def test_a_fence_of_an_old_version_is_left_out_with_a_warning(fence: Any) -> None:
    """QGroundControl passes over it too."""
    file = qgc_plan.read(plan_file(TAKEOFF) | {"geoFence": fence})
    assert file.geofence is None
    assert [warning.path for warning in file.warnings] == ["geoFence"]


@pytest.mark.parametrize("inside", [survey(), {"type": "ComplexItem", "complexItemType": "survey"}])
def test_a_survey_without_its_items_is_missing(inside: Any) -> None:
    file = qgc_plan.read(plan_file(TAKEOFF, inside, at(16)))
    assert [item.path for item in file.items] == ["mission.items.0", "mission.items.2"]
    (missing,) = file.missing
    assert missing.path == "mission.items.1"
    assert "has no items inside" in missing.message


def test_a_fence_of_polygons_is_a_geofence() -> None:
    ring = [[40.44, -3.74], [40.45, -3.74], [40.45, -3.73]]
    areas = [{"version": 1, "inclusion": side, "polygon": ring} for side in (True, False)]
    file = qgc_plan.read(fenced(polygons=areas))
    assert file.geofence == {"inclusion": [ring], "exclusion": [ring]}


@given(radius=st.floats(5.0, 2000.0), bearing=st.floats(0.0, math.tau))
def test_a_circle_becomes_a_polygon_on_the_safe_side(radius: float, bearing: float) -> None:
    circle = {"center": list(HOME), "radius": radius}
    areas = [{"version": 1, "inclusion": side, "circle": circle} for side in (True, False)]
    file = qgc_plan.read(fenced(circles=areas))
    assert len(file.warnings) == 2
    assert file.geofence is not None
    fence = read_as(Geofence, file.geofence)
    ground = LocalGround(*HOME)

    def away(distance_m: float) -> tuple[float, float]:
        return ground.place(distance_m * math.cos(bearing), distance_m * math.sin(bearing))

    assert not geometry.contains(fence.inclusion[0], away(radius * 1.001))
    assert geometry.contains(fence.inclusion[0], away(radius * 0.99))
    assert geometry.contains(fence.exclusion[0], away(radius * 0.999))
    assert not geometry.contains(fence.exclusion[0], away(radius * 1.01))


def test_what_a_plan_has_no_place_for_is_said() -> None:
    document = fenced(breachReturn=[40.0, -3.0, 50])
    paths = [warning.path for warning in qgc_plan.read(document).warnings]
    assert paths == ["geoFence.breachReturn"]


def test_rally_points_come_out_and_in_again() -> None:
    points = [{"latitude": 40.0, "longitude": -3.0, "altitude": 50.0}]
    written = qgc_plan.write([], Home(*HOME, 0.0), 5.0, None, points)
    assert written["rallyPoints"]["points"] == [[40.0, -3.0, 50.0]]
    assert list(qgc_plan.read(written).rally_points) == points


@pytest.mark.parametrize("point", [[40.0, -3.0], "40, -3, 50", {"latitude": 40.0}, None])
def test_a_rally_point_that_is_none_is_named(point: Any) -> None:
    document = fenced() | {"rallyPoints": {"version": 2, "points": [[40.0, -3.0, 50], point]}}
    with pytest.raises(InvalidError) as caught:
        qgc_plan.read(document)
    assert [fault.path for fault in caught.value.faults] == ["rallyPoints.points.1"]


def test_a_fence_comes_out_and_in_again() -> None:
    ring = [[40.44, -3.74], [40.45, -3.74], [40.45, -3.73]]
    fence = {"inclusion": [ring], "exclusion": [ring, ring], "max_altitude": 60.0}
    written = qgc_plan.write([], Home(*HOME, 0.0), 5.0, fence)
    assert qgc_plan.read(written).geofence == fence


@pytest.mark.thorough
@given(missions())
def test_a_written_file_has_what_qgroundcontrol_asks_for(mission: Mission) -> None:
    home = from_commands.home_of(mission)
    file = qgc_plan.write(from_commands.items_of(mission, home), home, mission.maximum_speed, None)
    assert (file["fileType"], file["version"]) == ("Plan", 1)
    assert isinstance(file["groundStation"], str)
    head = file["mission"]
    assert (head["version"], head["firmwareType"], head["vehicleType"]) == (2, 12, 2)
    assert all(isinstance(one, float) for one in head["plannedHomePosition"])
    assert file["geoFence"] == {"version": 2, "circles": [], "polygons": []}
    assert file["rallyPoints"] == {"version": 2, "points": []}
    for number, item in enumerate(head["items"], start=1):
        assert item["type"] == "SimpleItem"
        assert item["doJumpId"] == number
        assert item["autoContinue"] is True
        assert len(item["params"]) == 7
        assert isinstance(item["command"], int)
        assert item["frame"] == (3 if "Altitude" in item else 2)
        assert item.get("Altitude", item["params"][6]) == item["params"][6]


json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.floats()
    | st.sampled_from([0, 1, 2, 10**400, TAKEOFF])
    | st.just([TAKEOFF]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(
                [
                    "mission",
                    "items",
                    "type",
                    "complexItemType",
                    "polygons",
                    "circles",
                    "circle",
                    "inclusion",
                    "version",
                    "params",
                ]
            ),
            inner | st.sampled_from(["ComplexItem", "SimpleItem", "survey", 1, 2]),
            max_size=4,
        )
    ),
    max_leaves=10,
)


@pytest.mark.thorough
@given(json_values, st.sampled_from(["mission", "geoFence", "rallyPoints"]))
def test_anything_is_read_or_refused(value: Any, name: str) -> None:
    for document in (value, plan_file(TAKEOFF) | {name: value}):
        with contextlib.suppress(InvalidError):
            qgc_plan.read(document)
