"""Mission files of other programs over HTTP, in and out."""

import json
from typing import Any

import pytest
from werkzeug.test import TestResponse

from edge_server.api.routes.planning.plan_files import EXAMPLE
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import home, mission, plan, takeoff, waypoint
from tests.unit.edge_server.exchange.missions import TAKEOFF, at, plan_file, simple
from tests.unit.edge_server.exchange.test_waypoint_list import ARDUPILOT

BACK = simple(20, frame=2)
FILE = plan_file(TAKEOFF, at(16, 2, 1, 0, None), BACK)
RING = [[40.44, -3.74], [40.45, -3.74], [40.45, -3.73], [40.44, -3.73]]


def send(
    edge: Edge, document: Any = None, query: str = "vehicle_id=1", role: str = "operator"
) -> TestResponse:
    body = FILE if document is None else document
    return edge.post(f"/plans/import?{query}", body, role)


def refused(edge: Edge, answer: TestResponse, status: int) -> Any:
    assert answer.status_code == status, answer.json
    assert edge.get("/plans/") == []
    return (answer.json or {})["detail"]


def test_a_file_becomes_a_plan_that_is_held(edge: Edge) -> None:
    answer = send(edge)
    assert answer.status_code == 201
    stored: Any = answer.json
    assert answer.headers["Location"] == f"/plans/{stored['id']}/"
    assert edge.get("/plans/1") == stored
    (flown,) = stored["missions"]
    assert (flown["vehicle_id"], flown["dispatch_state"]) == (1, "held")
    assert [one["command_type_id"] for one in flown["command_array"]] == [1, 3, 11]
    assert edge.work() == []
    assert edge.ask("POST", "/plans/1/dispatch", "operator").status_code == 200
    assert len(edge.work()) == 1


def test_the_query_gives_what_the_file_lacks(edge: Edge) -> None:
    query = "vehicle_id=2&dispatch=true&mission_id=77&maximum_speed=2.5&name=South"
    stored: Any = send(edge, query=query).json
    (flown,) = stored["missions"]
    assert stored["name"] == "South"
    assert (flown["vehicle_id"], flown["mission_id"], flown["maximum_speed"]) == (2, 77, 2.5)
    assert [item["vehicle_id"] for item in edge.work()] == [2]


def test_a_waypoint_list_is_taken_as_text(edge: Edge) -> None:
    for media_type in ("text/plain", "application/octet-stream", "text/plain; charset=utf-8"):
        path = "/plans/import?vehicle_id=1"
        answer = edge.ask("POST", path, "farmer", data=ARDUPILOT, content_type=media_type)
        assert answer.status_code == 201
    assert [len(one["missions"][0]["command_array"]) for one in edge.get("/plans/")] == [4, 4, 4]


@pytest.mark.first_case
@pytest.mark.parametrize("raw", [json.dumps(FILE).encode(), ARDUPILOT.encode()])
def test_a_file_may_come_in_a_form_with_its_order(edge: Edge, raw: bytes) -> None:
    parts = [
        b'--x\r\nContent-Disposition: form-data; name="vehicle_id"\r\n\r\n2',
        b'--x\r\nContent-Disposition: form-data; name="f"; filename="a.plan"\r\n\r\n' + raw,
        b"--x--\r\n",
    ]
    answer = edge.ask(
        "POST",
        "/plan/import/",
        "operator",
        data=b"\r\n".join(parts),
        content_type="multipart/form-data; boundary=x",
    )
    assert answer.status_code == 201
    assert (answer.json or {})["missions"][0]["vehicle_id"] == 2


def test_the_fence_of_a_file_is_kept_and_the_rest_is_a_warning(edge: Edge) -> None:
    fence = {
        "version": 2,
        "circles": [],
        "polygons": [{"version": 1, "inclusion": True, "polygon": RING}],
    }
    rally = {"version": 2, "points": [[*RING[0], 50]]}
    stored: Any = send(edge, FILE | {"geoFence": fence, "rallyPoints": rally}).json
    assert stored["geofence"]["inclusion"] == [RING]
    assert [list(point.values()) for point in stored["rally_points"]] == [[*RING[0], 50.0]]
    assert "warnings" not in stored or stored["warnings"] == []
    away = [{"version": 1, "inclusion": True, "polygon": [[lat + 1, lon] for lat, lon in RING]}]
    answer = send(edge, FILE | {"geoFence": fence | {"polygons": away}}, "vehicle_id=2")
    assert answer.status_code == 422
    assert set((answer.json or {})["detail"]["json"]) == {"mission.items.0", "mission.items.1"}


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("query", "name"),
    [
        ("", "vehicle_id"),
        ("vehicle_id=0", "vehicle_id"),
        ("vehicle_id=one", "vehicle_id"),
        ("vehicle_id=1.5", "vehicle_id"),
        ("vehicle_id=1&dispatch=yes", "dispatch"),
        ("vehicle_id=1&mission_id=-1", "mission_id"),
        ("vehicle_id=1&maximum_speed=fast", "maximum_speed"),
        ("vehicle_id=1&maximum_speed=nan", "maximum_speed"),
        ("vehicle_id=1&name=", "name"),
    ],
)
def test_a_bad_order_is_refused_by_name(edge: Edge, query: str, name: str) -> None:
    assert list(refused(edge, send(edge, query=query), 422)["query"]) == [name]


def test_an_item_that_cannot_be_converted_is_refused_by_number(edge: Edge) -> None:
    jump = plan_file(TAKEOFF, simple(177, 1, 5, frame=2), BACK)
    detail = refused(edge, send(edge, jump), 422)
    (message,) = detail["json"]["mission.items.1"]
    assert message.startswith("item 2 (DO_JUMP) has no counterpart")


def test_a_value_out_of_range_is_refused_at_its_item(edge: Edge) -> None:
    high = plan_file(TAKEOFF, at(16, altitude=150), BACK)
    detail = refused(edge, send(edge, high), 422)
    (message,) = detail["json"]["mission.items.1"]
    assert message.startswith("parameters.altitude must be")


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("document", "query", "path"),
    [
        (FILE, "vehicle_id=9", "vehicle_id"),
        (plan_file(TAKEOFF, BACK, hoverSpeed=30), "vehicle_id=1", "maximum_speed"),
        (plan_file(at(16), BACK), "vehicle_id=1&dispatch=true", "mission.items.0"),
        ({"fileType": "Mission"}, "vehicle_id=1", "fileType"),
        ([], "vehicle_id=1", "fileType"),
    ],
)
def test_a_mission_that_cannot_be_flown_is_refused(
    edge: Edge, document: Any, query: str, path: str
) -> None:
    assert path in refused(edge, send(edge, document, query), 422)["json"]


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("raw", "media_type", "status"),
    [
        (b"{", "application/json", 400),
        (b"QGC WPL 100", "text/plain", 422),
        (b"hello", "text/plain", 422),
        (b"\xff\xfe", "application/octet-stream", 422),
        (b"", "text/plain", 422),
        (b"<plan/>", "text/xml", 415),
        (b"QGC" + b" " * 1024 * 1024, "text/plain", 413),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(
    edge: Edge, raw: bytes, media_type: str, status: int
) -> None:
    path = "/plans/import?vehicle_id=1"
    refused(edge, edge.ask("POST", path, "operator", data=raw, content_type=media_type), status)


def test_a_farmer_imports_drafts(edge: Edge) -> None:
    assert send(edge, role="farmer").status_code == 201
    assert send(edge, query="vehicle_id=1&dispatch=true", role="farmer").status_code == 403


def test_a_repeated_import_is_one_plan(edge: Edge) -> None:
    path = "/plans/import?vehicle_id=1"
    first = edge.post(path, FILE, "operator", key="one")
    edge.clock.pass_s(60)
    again = edge.post(path, FILE, "operator", key="one")
    assert (again.status_code, again.json) == (201, first.json)
    assert edge.post(f"{path}&name=x", FILE, "operator", key="one").status_code == 422


def test_a_plan_comes_out_as_a_file_and_in_again(edge: Edge) -> None:
    edge.post_plan(plan(dispatch=False))
    answer = edge.ask("GET", "/plans/1?format=plan", "farmer")
    assert answer.status_code == 200
    assert answer.headers["Content-Disposition"].endswith('filename="plan-1-vehicle-1.plan"')
    stored: Any = send(edge, answer.json).json
    commands = stored["missions"][0]["command_array"]
    kept = edge.get("/plans/1")["missions"][0]["command_array"]
    assert commands == kept


def test_a_plan_comes_out_as_a_list_of_waypoints_and_in_again(edge: Edge) -> None:
    edge.post_plan(plan(dispatch=False))
    answer = edge.ask("GET", "/plans/1?format=waypoints", "farmer")
    assert (answer.status_code, answer.mimetype) == (200, "text/plain")
    assert answer.headers["Content-Disposition"].endswith('filename="plan-1-vehicle-1.waypoints"')
    path = "/plans/import?vehicle_id=1"
    stored: Any = edge.ask(
        "POST", path, "operator", data=answer.text, content_type="text/plain"
    ).json
    kept = edge.get("/plans/1")["missions"][0]["command_array"]
    assert stored["missions"][0]["command_array"] == kept


def test_of_several_missions_one_is_asked_for(edge: Edge) -> None:
    edge.post_plan(plan(mission(1, 1), mission(2, 2), dispatch=False))
    path = "/plans/1?format=plan"
    without_vehicle = edge.ask("GET", path, "farmer")
    assert without_vehicle.status_code == 422
    assert "vehicle_id" in (without_vehicle.json or {})["detail"]["query"]
    assert edge.ask("GET", f"{path}&vehicle_id=2", "farmer").status_code == 200
    assert edge.ask("GET", f"{path}&vehicle_id=3", "farmer").status_code == 404
    assert edge.ask("GET", "/plans/9?format=plan", "farmer").status_code == 404
    assert edge.ask("GET", "/plans/1?format=kml", "farmer").status_code == 422


def test_holds_of_the_annex_come_out_in_seconds(edge: Edge) -> None:
    slow = [takeoff(), waypoint(hold_time=2), home()]
    edge.post_plan(plan(mission(command_array=slow), profile="annex", dispatch=False))
    written = edge.get("/plans/1?format=plan", "farmer")
    assert [item["params"][0] for item in written["mission"]["items"]] == [1.0, 0.0, 20.0, 0.0]


def test_the_contracts_example_is_taken(edge: Edge) -> None:
    operation = edge.get("/openapi.json")["paths"]["/plans/import/"]["post"]
    content = operation["requestBody"]["content"]
    assert content["application/json"]["example"] == EXAMPLE
    assert {"text/plain", "multipart/form-data"} <= set(content)
    assert send(edge, EXAMPLE).status_code == 201
    required = {one["name"] for one in operation["parameters"] if one.get("required")}
    assert required == {"vehicle_id"}


EMPTY_SURVEY = {"type": "ComplexItem", "complexItemType": "survey"}


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("document", "path"),
    [
        (plan_file(at(16), BACK), "missions.0.command_array.0.command_type_id"),
        (plan_file(TAKEOFF, EMPTY_SURVEY, BACK), "mission.items.1"),
    ],
)
def test_what_lacks_a_part_is_a_draft_until_it_is_whole(
    edge: Edge, document: dict[str, Any], path: str
) -> None:
    answer = send(edge, document)
    assert answer.status_code == 201, answer.json
    stored: Any = answer.json
    (warning,) = (one for one in stored["warnings"] if one["message"].startswith("missing: "))
    assert warning["path"] == path
    assert stored["missions"][0]["dispatch_state"] == "held"
    for _ in range(2):
        early = edge.ask("POST", "/plans/1/dispatch", "operator")
        assert early.status_code == 422
        assert path in (early.json or {})["detail"]["json"]
    assert edge.work() == []
    whole = plan(mission(7), dispatch=False)
    assert edge.ask("PUT", "/plans/1", "operator", json=whole).status_code == 200
    assert edge.ask("POST", "/plans/1/dispatch", "operator").status_code == 200
    assert len(edge.work()) == 1


@pytest.mark.first_case
@pytest.mark.parametrize(
    "document", [plan_file(at(16), BACK), plan_file(TAKEOFF, EMPTY_SURVEY, BACK)]
)
def test_what_lacks_a_part_is_not_flown_at_once(edge: Edge, document: dict[str, Any]) -> None:
    refused(edge, send(edge, document, "vehicle_id=1&dispatch=true"), 422)


def test_a_file_with_a_part_that_is_wrong_is_no_draft(edge: Edge) -> None:
    document = plan_file(at(16), EMPTY_SURVEY, at(21), at(16))
    detail = refused(edge, send(edge, document), 422)
    assert list(detail["json"]) == ["mission.items.3"]
    refused(edge, send(edge, plan_file(EMPTY_SURVEY)), 422)


def test_a_plan_that_is_posted_is_no_draft(edge: Edge) -> None:
    body = plan(mission(command_array=[waypoint(1), home(2)]), dispatch=False)
    assert edge.post_plan(body).status_code == 422
