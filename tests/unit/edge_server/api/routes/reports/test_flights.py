"""The flight archive over HTTP: what was flown stays when the cloud has the reports."""

import base64
import csv
import io
import math
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from tests.support.geodesy import LocalGround
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import JPEG, mission, mission_report, plan, telemetry

RUNNING, FINISHED = 2, 3
GPX = "{http://www.topografix.com/GPX/1/1}"


def begin(edge: Edge, mission_id: int = 1201, vehicle_id: int = 1) -> None:
    """Have the broker begin a mission."""
    assert edge.post_plan(plan(mission(mission_id, vehicle_id))).status_code == 201
    edge.accept()
    report(edge, RUNNING, 2, 1, 1, mission_id=mission_id, vehicle_id=vehicle_id)


def report(edge: Edge, status: int, *commands: int, **fields: Any) -> None:
    answer = edge.report("mission_report", mission_report(status, *commands, **fields))
    assert answer.status_code == 201, answer.json


def send(edge: Edge, kind: str, **fields: Any) -> int:
    answer = edge.report(kind, telemetry(kind) | fields)
    assert answer.status_code == 201, answer.json
    return int((answer.json or {})["id"])


def move(edge: Edge, points: int) -> None:
    """Send state vectors, one a second, each some metres north of the last one."""
    for number in range(points):
        edge.clock.pass_s(1.0)
        send(edge, "state_vector", sequence_number=number, latitude=40.4434 + number * 1e-4)


def fly(edge: Edge, mission_id: int = 1201) -> None:
    """Fly a mission with three points, a picture, a measurement and an alarm."""
    begin(edge, mission_id)
    move(edge, 3)
    for kind in ("image", "observation", "pose", "battery", "alarm"):
        send(edge, kind, sequence_number=mission_id)
    edge.clock.pass_s(1.0)
    report(edge, FINISHED, 3, 3, 3, mission_id=mission_id)
    edge.clock.pass_s(100.0)


def test_a_flown_mission_is_one_flight(edge: Edge) -> None:
    fly(edge)
    (flight,) = edge.get("/flights/")
    assert flight.pop("plan_id") == edge.get("/plans/1")["plan_id"]
    assert flight == {
        "id": 1,
        "plan_name": "North field",
        "vehicle_id": 1,
        "mission_id": 1201,
        "started_at": "2026-11-21T12:00:00Z",
        "ended_at": "2026-11-21T12:00:04Z",
        "mission_status_id": FINISHED,
        "distance_m": 22.2,
        "pictures": 1,
        "alarms": 1,
    }


@pytest.mark.parametrize(("north_m", "east_m"), [(200.0, 0.0), (0.0, 200.0), (-120.0, 160.0)])
def test_the_distance_flown_is_that_over_ground(edge: Edge, north_m: float, east_m: float) -> None:
    begin(edge)
    here = (40.4434, -3.7382)
    for number, place in enumerate((here, LocalGround(*here).place(north_m, east_m))):
        edge.clock.pass_s(1.0)
        latitude, longitude = place
        send(edge, "state_vector", sequence_number=number, latitude=latitude, longitude=longitude)
    flown_m = edge.get("/flights/1")["distance_m"]
    assert flown_m == pytest.approx(math.hypot(north_m, east_m), abs=0.11)


def test_a_flight_has_its_commands_and_their_results(edge: Edge) -> None:
    fly(edge)
    flight = edge.get("/flights/1")
    assert [one["command_status_name"] for one in flight["command_array"]] == ["FINISHED"] * 3
    first = flight["command_array"][0]
    assert (first["started_at"], first["ended_at"]) == (
        "2026-11-21T12:00:00Z",
        "2026-11-21T12:00:04Z",
    )
    assert [one["kind"] for one in flight["results"]] == ["pose", "battery"]
    assert flight["results"][1]["percentage"] == 0.8


def test_the_track_as_geojson(edge: Edge) -> None:
    fly(edge)
    answer = edge.ask("GET", "/flights/1/track", "farmer")
    assert answer.content_type == "application/geo+json"
    feature = answer.json or {}
    assert feature["geometry"]["type"] == "LineString"
    assert feature["geometry"]["coordinates"][0] == [-3.7382, 40.4434, 4.84]
    assert len(feature["geometry"]["coordinates"]) == 3
    times = feature["properties"]["coordinateProperties"]["times"]
    assert times == [f"2026-11-21T12:00:0{second}Z" for second in (1, 2, 3)]


@pytest.mark.parametrize(("points", "geometry"), [(0, None), (1, "Point"), (2, "LineString")])
def test_a_short_track_is_valid_geojson(edge: Edge, points: int, geometry: str | None) -> None:
    begin(edge)
    move(edge, points)
    feature = edge.get("/flights/1/track?format=geojson")
    assert (feature["geometry"] or {}).get("type") == geometry
    assert len(feature["properties"]["coordinateProperties"]["times"]) == points


def test_the_track_as_csv(edge: Edge) -> None:
    fly(edge)
    answer = edge.ask("GET", "/flights/1/track?format=csv", "operator")
    assert answer.content_type == "text/csv; charset=utf-8"
    rows = list(csv.DictReader(io.StringIO(answer.text)))
    assert [row["time"][-3:-1] for row in rows] == ["01", "02", "03"]
    assert (rows[0]["altitude_m"], rows[0]["heading_deg"]) == ("4.84", "87.0")
    assert rows[0]["battery_fraction"] == ""


def test_the_track_as_gpx(edge: Edge) -> None:
    begin(edge)
    edge.clock.pass_s(1.0)
    send(edge, "state_vector", longitude=180.0, latitude=1e-9, altitude=1e-9)
    answer = edge.ask("GET", "/flights/1/track?format=gpx", "operator")
    assert answer.content_type == "application/gpx+xml"
    root = ET.fromstring(answer.data)
    assert (root.tag, root.get("version")) == (f"{GPX}gpx", "1.1")
    (point,) = root.iter(f"{GPX}trkpt")
    # The schema: longitudes are below 180, numbers have no exponent
    assert (point.get("lat"), point.get("lon")) == ("0.00000000", "-180.00000000")
    assert [child.tag for child in point] == [f"{GPX}ele", f"{GPX}time"]


def test_an_unknown_format_is_named(edge: Edge) -> None:
    fly(edge)
    answer = edge.ask("GET", "/flights/1/track?format=kml", "operator")
    assert answer.status_code == 422
    assert list((answer.json or {})["detail"]["query"]) == ["format"]


def test_pictures_have_the_place_where_they_were_taken(edge: Edge) -> None:
    fly(edge)
    (picture,) = edge.get("/flights/1/pictures")
    assert picture["latitude"] == pytest.approx(40.4436)
    assert picture["thumbnail_url"] == f"{picture['url']}/thumbnail"
    answer = edge.ask("GET", picture["url"], "farmer")
    assert (answer.content_type, answer.data) == ("image/jpeg", JPEG)
    assert edge.ask("GET", "/flights/1/pictures/2", "farmer").status_code == 404


def test_a_picture_that_comes_after_the_next_mission_has_begun_belongs_to_its_flight(
    edge: Edge,
) -> None:
    fly(edge)
    begin(edge, 1202)
    edge.clock.pass_s(20.0)
    send(edge, "image", recorded_at="2026-11-21T12:00:02Z")
    assert edge.get("/flights/2/pictures") == []
    late = edge.get("/flights/1/pictures")[1]
    assert late["recorded_at"] == "2026-11-21T12:00:02Z"
    assert late["latitude"] == pytest.approx(40.4435)


@pytest.mark.parametrize(
    ("latitude", "longitude", "expected"),
    [
        ("+40.5", "-3.5", (40.5, -3.5, 40.0)),
        ("0.0", "0.0", None),
        ("140.5", "-3.5", None),
        ("40.5", "181.0", None),
        ("", "-3.5", None),
    ],
)
def test_the_place_that_a_camera_writes_is_that_of_its_picture(
    edge: Edge, latitude: str, longitude: str, expected: tuple[float, float, float] | None
) -> None:
    begin(edge)
    move(edge, 1)
    by_track = (
        40.4434,
        telemetry("state_vector")["longitude"],
        telemetry("state_vector")["altitude"],
    )
    data = (
        JPEG
        + (
            f'drone-dji:GpsLatitude="{latitude}" drone-dji:GpsLongitude="{longitude}" '
            'drone-dji:RelativeAltitude="+40.0"'
        ).encode()
    )
    send(edge, "image", image_size=len(data), frame=base64.b64encode(data).decode())
    (picture,) = edge.get("/flights/1/pictures")
    place = (picture["latitude"], picture["longitude"], picture["altitude"])
    assert place == pytest.approx(expected or by_track)


def test_observations_are_listed(edge: Edge) -> None:
    fly(edge)
    (measured,) = edge.get("/flights/1/observations")
    assert measured["observation_array"][0]["result_value"] == 20.0


def test_the_measurements_as_csv(edge: Edge) -> None:
    fly(edge)
    answer = edge.ask("GET", "/flights/1/observations?format=csv", "farmer")
    assert answer.content_type == "text/csv; charset=utf-8"
    assert "attachment" in answer.headers["Content-Disposition"]
    (row,) = csv.DictReader(io.StringIO(answer.text))
    assert row == {
        "time": "2024-06-17T13:14:06Z",
        "latitude_deg": "40.4434",
        "longitude_deg": "-3.7382",
        "altitude_m": "4.84",
        "resource": "temp",
        "property": "temperature",
        "value": "20.0",
        "unit": "C",
    }


def test_a_spreadsheet_calculates_nothing_that_a_vehicle_wrote(edge: Edge) -> None:
    begin(edge)
    one = {
        "resource_id": "=HYPERLINK(1)",
        "observed_property": 'leaf, "wet"',
        "result_time": 1718630046,
        "result_value": -1.5,
        "result_uom": "@x",
    }
    send(edge, "observation", observation_array=[one])
    answer = edge.ask("GET", "/flights/1/observations?format=csv", "operator")
    (row,) = csv.DictReader(io.StringIO(answer.text))
    assert (row["resource"], row["unit"]) == ("'=HYPERLINK(1)", "'@x")
    assert (row["property"], row["value"]) == ('leaf, "wet"', "-1.5")


def test_the_archive_keeps_what_the_outbox_deletes(edge: Edge) -> None:
    begin(edge)
    record_id = send(edge, "pose")
    assert edge.ask("GET", f"/pose/{record_id}", "operator").status_code == 200
    edge.ask("DELETE", f"/pose/{record_id}", "admin")
    assert edge.ask("GET", f"/pose/{record_id}", "operator").status_code == 404
    assert len(edge.get("/flights/1")["results"]) == 1


def test_the_lists_are_paged(edge: Edge) -> None:
    for number in range(3):
        fly(edge, 1201 + number)
    first = edge.get("/flights/?limit=2")
    rest = edge.get(f"/flights/?limit=2&after={first[-1]['id']}")
    assert [one["mission_id"] for one in first + rest] == [1201, 1202, 1203]
    assert edge.get("/flights/?vehicle_id=2") == []
    assert edge.get("/alarms/history/?limit=1&after=1")[0]["id"] == 2


@pytest.mark.parametrize(
    "path", ["", "/track", "/pictures", "/pictures/1", "/observations", "/track?format=gpx"]
)
def test_a_flight_that_is_not_in_the_archive_is_a_404(edge: Edge, path: str) -> None:
    assert edge.ask("GET", f"/flights/7{path}", "operator").status_code == 404
    fly(edge)
    assert edge.ask("GET", f"/flights/7{path}", "operator").status_code == 404


def test_a_key_for_another_vehicle_sees_no_flight(edge: Edge) -> None:
    fly(edge)
    wanted = {"name": "second", "role": "operator", "vehicle_ids": [2]}
    key = (edge.post("/keys/", wanted, "admin").json or {})["key"]
    headers = {"X-API-Key": key}
    assert edge.ask("GET", "/flights/", None, headers=headers).json == []
    for path in ("/flights/1", "/flights/1/track", "/flights/1/pictures/1"):
        assert edge.ask("GET", path, None, headers=headers).status_code == 403
    path = "/alarms/history/1/acknowledge"
    assert edge.ask("POST", path, None, headers=headers).status_code == 403


def test_an_alarm_is_acknowledged_once(edge: Edge) -> None:
    fly(edge)
    (alarm,) = edge.get("/alarms/history/")
    assert (alarm["flight_id"], alarm["acknowledged_at"]) == (1, None)
    first = edge.ask("POST", "/alarms/history/1/acknowledge", "operator")
    assert (first.json or {})["acknowledged_by"] == "operator"
    edge.clock.pass_s(5.0)
    again = edge.ask("POST", "/alarms/history/1/acknowledge", "admin")
    assert (first.status_code, again.status_code) == (200, 200)
    assert again.json == first.json == edge.get("/alarms/history/")[0]
    rows = edge.ask("GET", "/audit/", "admin").text
    assert rows.count('"alarms/history/1"') == 1


def test_an_alarm_outside_of_a_flight_is_in_the_history(edge: Edge) -> None:
    send(edge, "alarm", message="battery does not charge")
    (alarm,) = edge.get("/alarms/history/")
    assert (alarm["flight_id"], alarm["description"]) == (None, "battery does not charge")
    assert edge.get("/flights/") == []


def test_many_reports_in_one_request_are_archived(edge: Edge) -> None:
    begin(edge)
    end = mission_report(FINISHED, 3, 3, 3, sequence_number=1)
    records = [
        {"state_vector": telemetry("state_vector") | {"sequence_number": number}}
        for number in range(3)
    ]
    edge.post("/telemetry/", {"records": [*records, {"mission_report": end}]}, "broker")
    assert edge.get("/flights/1")["mission_status_id"] == FINISHED
    assert len(edge.get("/flights/1/track")["geometry"]["coordinates"]) == 3
