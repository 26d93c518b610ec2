"""GeoJSON in and out."""

import contextlib
import itertools
import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.faults import InvalidError
from edge_server.geodata import geojson
from edge_server.geodata.field import Field
from tests.support.cases import failures

OUTER = [[-3.74, 40.44], [-3.73, 40.44], [-3.73, 40.45], [-3.74, 40.45], [-3.74, 40.44]]
HOLE = [[-3.736, 40.444], [-3.734, 40.444], [-3.734, 40.446], [-3.736, 40.444]]
POLYGON = {"type": "Polygon", "coordinates": [OUTER, HOLE]}
EAST = [[longitude + 0.1, latitude] for longitude, latitude in OUTER]


def feature(geometry: Any = None, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry or POLYGON, "properties": properties}


def fields(document: Any) -> list[Field]:
    return [boundary.field for boundary in geojson.read(document).boundaries]


def faults(document: Any) -> dict[str, str]:
    with pytest.raises(InvalidError) as refused:
        geojson.read(document)
    return {fault.path: fault.message for fault in refused.value.faults}


@pytest.mark.parametrize(
    "document",
    [
        POLYGON,
        {"type": "MultiPolygon", "coordinates": [[OUTER, HOLE]]},
        feature(),
        {"type": "FeatureCollection", "features": [feature()]},
    ],
)
def test_one_polygon_is_one_field_latitude_first(document: Any) -> None:
    (field,) = fields(document)
    assert field.boundary == ((40.44, -3.74), (40.44, -3.73), (40.45, -3.73), (40.45, -3.74))
    assert field.holes == (((40.444, -3.736), (40.444, -3.734), (40.446, -3.734)),)
    assert field.name is None


def test_every_polygon_is_a_field_and_several_of_a_name_are_numbered() -> None:
    both = {"type": "MultiPolygon", "coordinates": [[OUTER], [EAST]]}
    collection = {
        "type": "FeatureCollection",
        "features": [feature(both, name="North"), feature(name="South")],
    }
    assert [field.name for field in fields(collection)] == ["North 1", "North 2", "South"]


@pytest.mark.parametrize(
    ("document", "name"),
    [
        (feature(Name="Hill"), "Hill"),
        (feature(title="Hill"), "Hill"),
        ({**feature(), "id": 7}, "7"),
        (feature(name=None), None),
        (feature(name=""), None),
        (feature(name="x" * 300), "x" * 255),
    ],
)
def test_the_name_is_the_features_own(document: Any, name: str | None) -> None:
    assert fields(document)[0].name == name


def test_heights_and_what_others_add_are_passed_over() -> None:
    document = feature({"type": "Polygon", "coordinates": [[[*p, 650.0] for p in OUTER]]}, crop="x")
    document["bbox"] = [-3.74, 40.44, -3.73, 40.45]
    assert fields(document)[0].boundary[0] == (40.44, -3.74)


@pytest.mark.parametrize(
    ("geometry", "path"),
    [
        ({"type": "Point", "coordinates": [0, 0]}, "features.0.geometry.type"),
        ({"type": "MultiLineString", "coordinates": [OUTER]}, "features.0.geometry.type"),
        (None, "features.0.geometry"),
    ],
)
def test_what_is_no_area_is_left_out_beside_one(geometry: Any, path: str) -> None:
    pin: dict[str, Any] = {"type": "Feature", "geometry": geometry, "properties": {"name": "Gate"}}
    document = {"type": "FeatureCollection", "features": [pin, feature()]}
    found = geojson.read(document)
    assert [one.path for one in found.boundaries] == ["features.1.geometry.coordinates"]
    assert [one.path for one in found.left_out] == [path]
    assert set(faults({**document, "features": [pin]})) == {path}  # Alone it is refused


INVALID: list[tuple[Any, str]] = [
    ([], ""),
    ({"type": "Point", "coordinates": [1, 2]}, "type"),
    ({"type": "GeometryCollection", "geometries": [POLYGON]}, "type"),
    (feature({"type": "LineString", "coordinates": OUTER}), "geometry.type"),
    ({"type": "Feature", "geometry": None, "properties": {}}, "geometry"),
    ({"type": "FeatureCollection"}, "features"),
    ({"type": "FeatureCollection", "features": []}, "features"),
    ({"type": "FeatureCollection", "features": [feature(), 5]}, "features.1.type"),
    ({"type": "FeatureCollection", "features": [POLYGON]}, "features.0.type"),
    (
        {
            "type": "FeatureCollection",
            "features": [feature(), feature({"type": "GeometryCollection", "geometries": []})],
        },
        "features.1.geometry.type",
    ),
    ({"type": "Polygon"}, "coordinates"),
    ({"type": "Polygon", "coordinates": []}, "coordinates"),
    ({"type": "Polygon", "coordinates": [OUTER[:4]]}, "coordinates.0"),
    ({"type": "Polygon", "coordinates": [OUTER[:2] + OUTER[:1]]}, "coordinates.0"),
    ({"type": "Polygon", "coordinates": [[*OUTER[:-1], [-3.74]]]}, "coordinates.0.4"),
    ({"type": "Polygon", "coordinates": [[["1", "2"], *OUTER]]}, "coordinates.0.0"),
    ({"type": "Polygon", "coordinates": [[[True, 2], *OUTER]]}, "coordinates.0.0"),
    ({"type": "Polygon", "coordinates": [[[float("nan"), 2], *OUTER]]}, "coordinates.0.0"),
    ({"type": "Polygon", "coordinates": [[[181, 2], *OUTER]]}, "coordinates.0.0.0"),
    ({"type": "Polygon", "coordinates": [[[40.0, -93.7], *OUTER]]}, "coordinates.0.0.1"),
    ({"type": "Polygon", "coordinates": [OUTER, EAST]}, "coordinates.1"),
    (
        {
            "type": "MultiPolygon",
            "coordinates": [
                [OUTER],
                [[[0, 0], [0.01, 0.01], [0.01, 0], [0, 0.01], [0, 0]]],
            ],
        },
        "coordinates.1.0",
    ),
    ({"type": "MultiPolygon", "coordinates": [[OUTER]] * 101}, "coordinates.0"),
    ({"type": "MultiPolygon", "coordinates": []}, "coordinates"),
    ({"type": "FeatureCollection", "features": [feature()] * 101}, "features"),
    ({**POLYGON, "crs": {"type": "name", "properties": {"name": "EPSG:25830"}}}, "crs"),
    ({**POLYGON, "crs": 5}, "crs"),
    (feature(exclusions=[[[1, 2]]]), "properties.exclusions.0"),
    (feature(entry=[1]), "properties.entry"),
    (feature(entry=[-3.74, 41.0]), "properties.entry"),
    (
        feature({"type": "MultiPolygon", "coordinates": [[OUTER], [EAST]]}, entry=OUTER[0]),
        "properties.entry",
    ),
    (
        feature({"type": "MultiPolygon", "coordinates": [[OUTER], [EAST]]}, exclusions=[HOLE]),
        "properties.exclusions",
    ),
]


def check_invalid(document: Any, path: str) -> None:
    assert path in faults(document)


def test_an_invalid_boundary_is_refused_with_its_path() -> None:
    assert failures(check_invalid, INVALID) == []


def test_all_faults_are_told_at_once() -> None:
    broken = {"type": "Polygon", "coordinates": [OUTER[:4]]}
    collection = {"type": "FeatureCollection", "features": [feature(broken), feature(broken)]}
    found = faults(collection)
    assert set(found) == {f"features.{index}.geometry.coordinates.0" for index in range(2)}


def test_the_old_way_to_say_wgs84_is_understood() -> None:
    name = "urn:ogc:def:crs:OGC:1.3:CRS84"
    assert fields({**POLYGON, "crs": {"type": "name", "properties": {"name": name}}})


coordinate = st.tuples(st.floats(-0.004, 0.004), st.floats(-0.004, 0.004))


@given(
    corner=coordinate,
    name=st.none() | st.text("abcé/", min_size=1),
    hole=st.booleans(),
    turns=st.booleans(),
)
def test_out_and_in_again_is_the_same_field(
    corner: tuple[float, float], name: str | None, *, hole: bool, turns: bool
) -> None:
    boundary = ((40.44, -3.74), (40.44, -3.73), (40.45 + corner[0], -3.73 + corner[1]))
    inner = ((40.4401, -3.7345), (40.4401, -3.7341), (40.4404, -3.7341))
    field = Field(
        name=name,
        boundary=tuple(reversed(boundary)) if turns else boundary,
        holes=(inner,) if hole else (),
        exclusions=(inner,),
    )
    shown = {"id": 3, "area_m2": 5.0, **field.model_dump(mode="json", exclude_none=True)}
    written = json.loads(json.dumps(geojson.write([shown])))
    (again,) = fields(written)
    assert again.name == (name or "3")
    assert [set(one) for one in (again.boundary, *again.holes, *again.exclusions)] == [
        set(one) for one in (field.boundary, *field.holes, *field.exclusions)
    ]
    outer, *holes = written["features"][0]["geometry"]["coordinates"]
    assert signed_area(outer) > 0
    assert all(signed_area(one) < 0 for one in holes)


def signed_area(ring: list[list[float]]) -> float:
    """Of a closed ring; positive when it runs anticlockwise."""
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in itertools.pairwise(ring))


json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.floats()
    | st.text(max_size=3)
    | st.sampled_from([OUTER, POLYGON]),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(["type", "coordinates", "features", "geometry", "properties", "crs"]),
            inner | st.sampled_from(sorted(geojson.TYPES)),
            max_size=5,
        )
    ),
    max_leaves=12,
)


@pytest.mark.thorough
@given(json_values)
def test_anything_is_read_or_refused(document: Any) -> None:
    geojson.is_geojson(document)
    with contextlib.suppress(InvalidError):
        assert all(isinstance(field, Field) for field in fields(document))


def test_an_entry_is_a_position_in_and_out() -> None:
    (field,) = fields(feature(entry=[-3.7395, 40.4401]))
    assert field.entry == (40.4401, -3.7395)
    written = geojson.write_one({"id": 1, **field.model_dump(mode="json")})
    assert written["properties"]["entry"] == [-3.7395, 40.4401]
    assert fields(written)[0].entry == field.entry
