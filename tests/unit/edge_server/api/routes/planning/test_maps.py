"""The maps folder over HTTP: what is listed, ranges of a PMTiles archive, what cannot be shown."""

import struct
from pathlib import Path

import pytest

from tests.unit.edge_server.conftest import Edge

BOUNDS = (-3.75, 40.43, -3.72, 40.45)
RASTER, VECTOR = 2, 1


def pmtiles(kind: int = RASTER, version: int = 3, magic: bytes = b"PMTiles") -> bytes:
    """The header of an archive, and some bytes after it."""
    degrees = [round(each * 1e7) for each in BOUNDS]
    offsets = struct.pack("<11Q", 127, 6, 133, 50, 183, 0, 183, 200, 1, 1, 1)
    head = magic + bytes([version]) + offsets + bytes([1, 2, 2, kind, 12, 18])
    return head + struct.pack("<4i", *degrees) + bytes(9) + bytes(range(256))


def put(edge: Edge, name: str, data: bytes) -> Path:
    """Put a file into the maps folder."""
    edge.config.maps_dir.mkdir(exist_ok=True)
    path = edge.config.maps_dir / name
    path.write_bytes(data)
    return path


def test_without_a_folder_there_are_no_maps(edge: Edge) -> None:
    assert edge.get("/maps/") == []
    assert edge.ask("GET", "/maps/farm.pmtiles", "farmer").status_code == 404


@pytest.mark.parametrize(("kind", "name"), [(RASTER, "raster_tiles"), (VECTOR, "vector_tiles")])
def test_an_archive_is_listed_with_its_place(edge: Edge, kind: int, name: str) -> None:
    put(edge, "north farm.pmtiles", pmtiles(kind))
    (found,) = edge.get("/maps/", "farmer")
    assert found["bounds"] == pytest.approx(BOUNDS)
    del found["bounds"]
    assert found == {
        "name": "north farm.pmtiles",
        "kind": name,
        "url": "/maps/north%20farm.pmtiles",
        "minimum_zoom": 12,
        "maximum_zoom": 18,
        "corners": None,
        "fault": None,
    }


def test_a_range_of_an_archive(edge: Edge) -> None:
    data = pmtiles()
    put(edge, "north farm.pmtiles", data)
    whole = edge.ask("GET", "/maps/north%20farm.pmtiles", "farmer")
    assert (whole.status_code, whole.data) == (200, data)
    headers = {"Range": "bytes=130-139"}
    part = edge.ask("GET", "/maps/north%20farm.pmtiles", "farmer", headers=headers)
    assert (part.status_code, part.data) == (206, data[130:140])
    assert part.headers["Content-Range"] == f"bytes 130-139/{len(data)}"
    assert part.headers["ETag"] == whole.headers["ETag"]


def test_a_range_outside_of_the_archive_is_416(edge: Edge) -> None:
    put(edge, "farm.pmtiles", pmtiles())
    headers = {"Range": "bytes=5000-6000"}
    assert edge.ask("GET", "/maps/farm.pmtiles", "farmer", headers=headers).status_code == 416


def test_a_caller_that_has_an_archive_receives_304(edge: Edge) -> None:
    path = put(edge, "farm.pmtiles", pmtiles())
    tag = edge.ask("GET", "/maps/farm.pmtiles", "farmer").headers["ETag"]
    headers = {"If-None-Match": tag}
    again = edge.ask("GET", "/maps/farm.pmtiles", "farmer", headers=headers)
    assert (again.status_code, again.data) == (304, b"")
    path.write_bytes(pmtiles() + b"more")
    changed = edge.ask("GET", "/maps/farm.pmtiles", "farmer", headers=headers)
    assert changed.status_code == 200


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (b"", "it is not a PMTiles archive"),
        (pmtiles(magic=b"SQLite "), "it is not a PMTiles archive"),
        (pmtiles(version=2), "PMTiles version 2 is not supported, only version 3"),
        (pmtiles()[:-10], "it is cut off: it has 373 of 383 bytes; copy it again"),
        (pmtiles()[:120], "it is cut off: it has 120 of 383 bytes; copy it again"),
        (pmtiles(kind=9), "tiles of kind 9 are not supported: only MVT, PNG, JPEG, WebP"),
    ],
)
def test_what_cannot_be_shown_is_listed_with_the_reason(
    edge: Edge, data: bytes, fault: str
) -> None:
    put(edge, "broken.pmtiles", data)
    put(edge, "farm.pmtiles", pmtiles())
    broken, sound = edge.get("/maps/")
    assert (broken["fault"], broken["url"]) == (fault, None)
    assert (sound["fault"], sound["url"]) == (None, "/maps/farm.pmtiles")


@pytest.mark.parametrize("name", ["..%2Fedge%2Fedge.sqlite3", "notes.txt", "secret.pmtiles", "%00"])
def test_nothing_but_maps_of_the_folder_is_served(edge: Edge, name: str) -> None:
    put(edge, "notes.txt", b"not a map")
    (edge.config.state_dir / "elsewhere.pmtiles").write_bytes(pmtiles())
    (edge.config.maps_dir / "secret.pmtiles").symlink_to(
        edge.config.state_dir / "elsewhere.pmtiles"
    )
    assert edge.get("/maps/") == []
    assert edge.ask("GET", f"/maps/{name}", "farmer").status_code == 404
