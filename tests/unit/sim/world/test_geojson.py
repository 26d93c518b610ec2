"""The farm as a map for other programs."""

import json
from itertools import pairwise

import pytest

import sim.world.__main__
from sim.world.farm import Farm
from sim.world.geojson import farm_geojson, rows
from sim.world.geometry import chord, edge_distance_m
from sim.world.layout import FIELDS
from sim.world.plane import Place

SQUARE = (Place(0.0, 0.0), Place(10.0, 0.0), Place(10.0, 10.0), Place(0.0, 10.0))


def test_the_map_is_rings_that_close_and_run_counter_clockwise() -> None:
    collection = json.loads(json.dumps(farm_geojson(Farm())))
    assert collection["type"] == "FeatureCollection"
    for feature in collection["features"]:
        if feature["geometry"]["type"] != "Polygon":
            continue
        (ring,) = feature["geometry"]["coordinates"]
        assert ring[0] == ring[-1]
        corners = pairwise(ring)
        assert sum(a[0] * b[1] - b[0] * a[1] for a, b in corners) > 0.0


def test_fields_rows_and_drip_lines_are_on_it() -> None:
    features = farm_geojson(Farm())["features"]
    kinds = [feature["properties"]["kind"] for feature in features]
    assert {"field", "crop_row", "drip_line", "track", "building", "tree", "yard"} == set(kinds)
    assert kinds.count("field") == len(FIELDS)
    longitude, latitude = features[0]["geometry"]["coordinates"][0][0]
    assert (latitude, longitude) == pytest.approx((40.4434, -3.7382), abs=0.002)


def test_rows_lie_in_their_field_at_their_distance_from_each_other() -> None:
    for field in FIELDS:
        found = list(rows(field))
        for row in found:
            assert edge_distance_m(field.boundary, row.start) == pytest.approx(0.0, abs=1e-6)
            assert edge_distance_m(field.boundary, row.end) == pytest.approx(0.0, abs=1e-6)
        east, north = field.across
        offsets = [row.start.east_m * east + row.start.north_m * north for row in found]
        gaps = [b - a for a, b in pairwise(offsets)]
        assert gaps == pytest.approx([field.row_spacing_m] * len(gaps))


def test_a_line_enters_and_leaves_a_ring() -> None:
    ends = chord(SQUARE, Place(5.0, 3.0), 90.0)
    assert ends is not None
    assert ends[0] == pytest.approx((0.0, 3.0))
    assert ends[1] == pytest.approx((10.0, 3.0))
    assert chord(SQUARE, Place(5.0, 13.0), 90.0) is None


def test_the_distance_to_the_edge_tells_inside_from_outside() -> None:
    assert edge_distance_m(SQUARE, (2.0, 5.0)) == pytest.approx(2.0)
    assert edge_distance_m(SQUARE, (-1.5, 5.0)) == pytest.approx(-1.5)


def test_the_farm_is_printed_as_geojson(capsys: pytest.CaptureFixture[str]) -> None:
    assert sim.world.__main__.main() == 0
    assert json.loads(capsys.readouterr().out)["type"] == "FeatureCollection"
