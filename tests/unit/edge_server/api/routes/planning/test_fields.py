"""Fields over HTTP: in as files of many kinds, out as JSON or GeoJSON."""

import json
from typing import Any

import pytest
from werkzeug.test import TestResponse

from edge_server.api.routes.planning.fields import EXAMPLE
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.geodata.shapefiles import archive, dbf, record, shp
from tests.unit.edge_server.geodata.test_geojson import EAST, OUTER, POLYGON, feature
from tests.unit.edge_server.geodata.test_kml import file, placemark, polygon, zipped

KML = "application/vnd.google-earth.kml+xml"
KMZ = "application/vnd.google-earth.kmz"
SHAPEFILE = archive(
    shp(record([(-3.74, 40.44), (-3.74, 40.45), (-3.73, 40.45)])), table=dbf([b"North"])
)
GEOJSON = "application/geo+json"
DOCUMENT = file(placemark(polygon(), name="North"))


def send(edge: Edge, raw: bytes, media_type: str, role: str = "farmer") -> TestResponse:
    return edge.ask("POST", "/fields/", role, data=raw, content_type=media_type)


def send_form(edge: Edge, **files: bytes) -> TestResponse:
    parts = [
        f'--x\r\nContent-Disposition: form-data; name="{name}"; filename="{name}"\r\n\r\n'.encode()
        + raw
        for name, raw in files.items()
    ]
    body = b"\r\n".join([*parts, b"--x--\r\n"])
    return send(edge, body, "multipart/form-data; boundary=x")


def test_a_field_is_kept_and_shown(edge: Edge) -> None:
    answer = edge.post("/fields/", EXAMPLE, "farmer")
    assert answer.status_code == 201
    assert answer.headers["Location"] == "/fields/1/"
    stored: Any = answer.json
    assert stored == {
        "id": 1,
        **EXAMPLE,
        "holes": [],
        "area_m2": stored["area_m2"],
        "received_at": "2026-11-21T12:00:00Z",
        "updated_at": "2026-11-21T12:00:00Z",
    }
    assert stored["area_m2"] == pytest.approx(111.3 * 101.7, rel=0.01)
    assert edge.get("/field/1") == stored
    assert edge.get("/fields") == [stored]


def test_a_field_whose_name_cannot_be_shown_is_refused_and_changes_nothing(edge: Edge) -> None:
    odd = EXAMPLE | {"name": "North\u202e"}
    for answer in (edge.post("/fields/", odd, "farmer"), _replace_first(edge, odd)):
        assert answer.status_code == 422
        assert list((answer.json or {})["detail"]["json"]) == ["name"]
    assert [one["name"] for one in edge.get("/fields")] == [EXAMPLE["name"]]


def _replace_first(edge: Edge, document: dict[str, Any]) -> TestResponse:
    assert edge.post("/fields/", EXAMPLE, "farmer").status_code == 201
    return edge.ask("PUT", "/fields/1/", "farmer", json=document)


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("raw", "media_type"),
    [
        (json.dumps(feature(name="North")).encode(), GEOJSON),
        (json.dumps(feature(name="North")).encode(), "application/json"),
        (DOCUMENT, KML),
        (DOCUMENT, "text/xml"),
        (DOCUMENT, "application/octet-stream"),
        (zipped(("doc.kml", DOCUMENT)), KMZ),
        (zipped(("doc.kml", DOCUMENT)), "application/octet-stream"),
        (zipped(("doc.kml", DOCUMENT)), "application/zip"),
        (SHAPEFILE, "application/zip"),
        (SHAPEFILE, "application/x-zip-compressed"),
        (SHAPEFILE, "application/octet-stream"),
    ],
)
def test_a_file_is_taken_as_what_it_is(edge: Edge, raw: bytes, media_type: str) -> None:
    answer = send(edge, raw, media_type)
    assert (answer.status_code, (answer.json or {})["name"]) == (201, "North")
    assert (answer.json or {})["boundary"][0] == [40.44, -3.74]


@pytest.mark.first_case
@pytest.mark.parametrize(
    "raw",
    [
        DOCUMENT,
        zipped(("doc.kml", DOCUMENT)),
        SHAPEFILE,
        json.dumps(feature(name="North")).encode(),
    ],
)
def test_a_file_may_come_in_a_form(edge: Edge, raw: bytes) -> None:
    answer = send_form(edge, file=raw)
    assert (answer.status_code, (answer.json or {})["name"]) == (201, "North")


def test_the_fields_of_a_file_are_kept_together(edge: Edge) -> None:
    both = {"type": "MultiPolygon", "coordinates": [[OUTER], [EAST]]}
    answer = edge.post("/fields/", both, "operator")
    assert answer.status_code == 201
    kept = (answer.json or {})["fields"]
    assert [one["id"] for one in kept] == [1, 2]
    assert kept == edge.get("/fields/")


def test_a_repeated_file_makes_no_second_fields(edge: Edge) -> None:
    both = {"type": "MultiPolygon", "coordinates": [[OUTER], [EAST]]}
    first = edge.post("/fields/", both, "operator", key="one")
    edge.post("/fields/", EXAMPLE, "operator")
    again = edge.post("/fields/", both, "operator", key="one")
    assert (again.status_code, again.json) == (201, first.json)
    assert edge.post("/fields/", EXAMPLE, "operator", key="one").status_code == 422
    assert edge.count("field") == 3


def refusal(edge: Edge, answer: TestResponse, status: int) -> Any:
    assert answer.status_code == status, answer.json
    assert edge.count("field") == 0
    return (answer.json or {})["detail"]


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({"boundary": [[40, -3], [41, -3]]}, "boundary"),
        ({"boundary": [[91, -3], [41, -3], [41, -2]]}, "boundary.0.0"),
        ({"boundary": [[40, -3], [40.001, -2.999], [40.001, -3], [40, -2.999]]}, "boundary"),
        ({"holes": [[[10, 10], [10, 11], [11, 11]]]}, "holes.0"),
        ({"exclusions": [EXAMPLE["boundary"]] * 51}, "exclusions"),
        ({"name": ""}, "name"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_a_bad_field_is_refused_by_place(edge: Edge, changes: Any, path: str) -> None:
    answer = edge.post("/fields/", {**EXAMPLE, **changes}, "operator")
    assert path in refusal(edge, answer, 422)["json"]


def test_one_bad_part_of_a_file_refuses_all_of_it(edge: Edge) -> None:
    crossed = {"type": "Polygon", "coordinates": [[[0, 0], [1, 1], [1, 0], [0, 1], [0, 0]]]}
    point = {"type": "Point", "coordinates": [0, 0]}
    features = [feature(), feature(crossed), feature(point)]
    answer = edge.post("/fields/", {"type": "FeatureCollection", "features": features}, "operator")
    assert list(refusal(edge, answer, 422)["json"]) == ["features.1.geometry.coordinates.0"]


def test_what_is_no_area_of_a_file_is_named_beside_its_fields(edge: Edge) -> None:
    point = {"type": "Point", "coordinates": [0, 0]}
    collection = {"type": "FeatureCollection", "features": [feature(), feature(point)]}
    answer = edge.post("/fields/", collection, "operator")
    assert answer.status_code == 201
    assert answer.json is not None
    assert [one["id"] for one in answer.json["fields"]] == [1]
    (left_out,) = answer.json["left_out"]
    assert left_out["path"] == "features.1.geometry.type"
    assert left_out["message"] == "must be Polygon or MultiPolygon"


def test_a_file_may_begin_with_a_byte_order_mark(edge: Edge) -> None:
    raw = b"\xef\xbb\xbf" + json.dumps(feature()).encode()
    assert (
        edge.ask("POST", "/fields/", "operator", data=raw, content_type=GEOJSON).status_code == 201
    )


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("raw", "media_type", "status"),
    [
        (b"{", GEOJSON, 400),
        (b"\xff", "application/json", 400),
        (b"[1]", "application/json", 422),
        (b"hello", "application/octet-stream", 422),
        (b"<kml/>", KML, 422),
        (b"PK\x03\x04", KMZ, 422),
        (b"PK\x03\x04", "application/zip", 422),
        (b"PK\x03\x04", "application/octet-stream", 422),
        (b"no zip", "application/zip", 422),
        (b"name=1", "application/x-www-form-urlencoded", 415),
        (b"x", "text/plain", 415),
        (b" " * (1024 * 1024 + 1), KML, 413),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(
    edge: Edge, raw: bytes, media_type: str, status: int
) -> None:
    refusal(edge, send(edge, raw, media_type), status)


@pytest.mark.parametrize("media_type", [KMZ, "application/zip"])
def test_a_file_that_says_it_is_an_archive_is_no_xml(edge: Edge, media_type: str) -> None:
    answer = send(edge, b"\x00broken", media_type)
    assert refusal(edge, answer, 422)["json"] == {"": ["is no zip archive"]}


def test_a_kmz_may_be_kml_that_nobody_has_packed(edge: Edge) -> None:
    assert send(edge, DOCUMENT, KMZ).status_code == 201


def test_a_shapefile_is_refused_with_the_file_of_the_archive(edge: Edge) -> None:
    raw = archive(shp(record([(-3.74, 40.44), (-3.74, 40.45), (-3.73, 40.45)])), None)
    answer = send(edge, raw, "application/zip")
    assert "farm/north.prj" in refusal(edge, answer, 422)["json"]


def test_a_form_has_one_file_of_a_bounded_size(edge: Edge) -> None:
    assert "file" in refusal(edge, send_form(edge), 422)["form"]
    assert "file" in refusal(edge, send_form(edge, one=DOCUMENT, two=DOCUMENT), 422)["form"]
    refusal(edge, send_form(edge, file=b" " * (1024 * 1024 + 1)), 413)
    refusal(edge, send_form(edge, file=b" " * (2 * 1024 * 1024)), 413)
    torn = send(edge, b"--x\r\nContent-Disposition", "multipart/form-data; boundary=x")
    refusal(edge, torn, 422)
    refusal(edge, send(edge, b"", "multipart/form-data"), 422)


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("query", "accept"), [("?format=geojson", "*/*"), ("", GEOJSON), ("?format=geojson", KML)]
)
def test_geojson_comes_out_when_asked_for(edge: Edge, query: str, accept: str) -> None:
    edge.post("/fields/", feature(name="North"), "operator")
    headers = {"Accept": accept}
    one = edge.ask("GET", f"/fields/1{query}", "farmer", headers=headers)
    many = edge.ask("GET", f"/fields/{query}", "farmer", headers=headers)
    assert one.content_type == many.content_type == GEOJSON
    outer, hole = json.loads(one.data)["geometry"]["coordinates"]
    assert (outer, hole) == (POLYGON["coordinates"][0], POLYGON["coordinates"][1][::-1])
    assert json.loads(many.data)["features"] == [json.loads(one.data)]


@pytest.mark.first_case
@pytest.mark.parametrize(
    "accept", ["*/*", "application/json", "text/html", f"{GEOJSON};q=0.5, */*"]
)
def test_json_comes_out_otherwise(edge: Edge, accept: str) -> None:
    edge.post("/fields/", EXAMPLE, "operator")
    answer = edge.ask("GET", "/fields/1", "farmer", headers={"Accept": accept})
    assert answer.content_type == "application/json"
    asked = edge.ask("GET", "/fields/1?format=json", "farmer", headers={"Accept": GEOJSON})
    assert asked.json == answer.json


def test_an_unknown_format_is_refused(edge: Edge) -> None:
    edge.post("/fields/", EXAMPLE, "operator")
    for path in ("/fields/1?format=shp", "/fields/?format=shp"):
        answer = edge.ask("GET", path, "operator")
        assert answer.status_code == 422
        assert "format" in (answer.json or {})["detail"]["query"]


def test_a_field_gets_another_boundary(edge: Edge) -> None:
    edge.post("/fields/", EXAMPLE, "operator")
    tag = edge.ask("GET", "/fields/1", "farmer").headers["ETag"]
    edge.clock.pass_s(5)
    changed = edge.ask("PUT", "/fields/1", "farmer", json=feature(name="New"))
    assert changed.status_code == 200
    stored = edge.get("/fields/1")
    assert (stored["name"], stored["exclusions"]) == ("New", [])
    assert stored["received_at"] < stored["updated_at"]
    stale = edge.ask("PUT", "/fields/1", "farmer", json=EXAMPLE, headers={"If-Match": tag})
    assert stale.status_code == 412
    assert edge.get("/fields/1") == stored


def test_two_boundaries_do_not_fit_into_one_field(edge: Edge) -> None:
    edge.post("/fields/", EXAMPLE, "operator")
    both = {"type": "MultiPolygon", "coordinates": [[OUTER], [EAST]]}
    assert edge.ask("PUT", "/fields/1", "farmer", json=both).status_code == 422
    assert edge.ask("PUT", "/fields/9", "farmer", json=EXAMPLE).status_code == 404


@pytest.mark.thorough
def test_a_deleted_field_is_gone_and_its_id_is_not_reused(edge: Edge) -> None:
    edge.post("/fields/", EXAMPLE, "operator")
    assert edge.ask("DELETE", "/fields/1", "operator").status_code == 204
    assert edge.ask("GET", "/fields/1", "operator").status_code == 404
    assert edge.ask("DELETE", "/fields/1", "operator").status_code == 404
    assert (edge.post("/fields/", EXAMPLE, "operator").json or {})["id"] == 2


def test_lists_are_continued_and_filtered(edge: Edge) -> None:
    for _ in range(3):
        edge.post("/fields/", EXAMPLE, "operator")
        edge.clock.pass_s(10)
    assert [one["id"] for one in edge.get("/fields/?after=1&limit=1")] == [2]
    assert [one["id"] for one in edge.get("/fields/?since=2026-11-21T12:00:10Z")] == [2, 3]


def test_the_answer_has_the_members_of_the_contract(edge: Edge) -> None:
    document = edge.get("/openapi.json")
    schema = document["components"]["schemas"]["StoredField"]
    stored = edge.post("/fields/", EXAMPLE, "operator").json or {}
    assert set(schema["required"]) <= set(stored) <= set(schema["properties"])
    body = document["paths"]["/fields/"]["post"]["requestBody"]["content"]
    assert {GEOJSON, KML, KMZ, "multipart/form-data", "application/json"} <= set(body)
