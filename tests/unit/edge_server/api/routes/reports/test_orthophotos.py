"""GeoTIFFs of the maps folder over HTTP: their place, their picture, what is not supported."""

import io
import struct
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from tests.support.geotiff import KEYS, NO_DATA, SCALE, TIEPOINT, TRANSFORMATION, geotiff, utm
from tests.unit.edge_server.conftest import Edge

WEST, NORTH, PIXEL_DEG = -3.7390, 40.4440, 1e-5
GREEN = (40, 160, 60)


def field(mode: str = "RGB", size: tuple[int, int] = (60, 40), colour: Any = GREEN) -> Image.Image:
    return Image.new(mode, size, colour)


def aerial(**options: Any) -> bytes:
    """A green picture of a field, in degrees."""
    return geotiff(options.pop("picture", field()), WEST, NORTH, PIXEL_DEG, **options)


def put(edge: Edge, data: bytes, name: str = "north field.tif") -> Path:
    edge.config.maps_dir.mkdir(exist_ok=True)
    path = edge.config.maps_dir / name
    path.write_bytes(data)
    return path


def listed(edge: Edge, data: bytes) -> dict[str, Any]:
    """The only map of the folder as the list shows it."""
    put(edge, data)
    (found,) = edge.get("/maps/", "farmer")
    return dict(found)


def shown(edge: Edge, data: bytes) -> Image.Image:
    """The picture of the only map of the folder."""
    answer = edge.ask("GET", listed(edge, data)["url"], "farmer")
    assert (answer.status_code, answer.content_type) == (200, "image/webp"), answer.json
    return Image.open(io.BytesIO(answer.data)).convert("RGBA")


def is_near(pixel: Any, *wanted: int) -> bool:
    return all(abs(one - other) < 16 for one, other in zip(pixel, wanted, strict=False))


def test_a_picture_in_degrees_has_its_corners(edge: Edge) -> None:
    found = listed(edge, aerial())
    assert (found["kind"], found["fault"]) == ("picture", None)
    assert found["url"] == "/maps/north%20field.tif/picture"
    south, east = NORTH - 40 * PIXEL_DEG, WEST + 60 * PIXEL_DEG
    corners = [[NORTH, WEST], [NORTH, east], [south, east], [south, WEST]]
    assert [each for corner in found["corners"] for each in corner] == pytest.approx(
        [each for corner in corners for each in corner], abs=1e-9
    )
    assert found["bounds"] == pytest.approx([WEST, south, east, NORTH], abs=1e-9)


@pytest.mark.parametrize(
    ("code", "easting_m", "northing_m", "latitude_deg", "longitude_deg"),
    [
        (32630, 500_000.0, 4_427_757.219, 40.0, -3.0),
        (25830, 500_000.0, 4_427_757.219, 40.0, -3.0),
        (32730, 500_000.0, 10_000_000.0 - 4_427_757.219, -40.0, -3.0),
    ],
)
def test_a_picture_in_a_zone_of_utm_has_its_corners(
    edge: Edge,
    code: int,
    easting_m: float,
    northing_m: float,
    latitude_deg: float,
    longitude_deg: float,
) -> None:
    found = listed(edge, geotiff(field(), easting_m, northing_m, 0.1, utm(code)))
    assert found["fault"] is None
    assert found["corners"][0] == pytest.approx([latitude_deg, longitude_deg], abs=1e-8)
    # 6 m to the east: 6 / 0.9996 m on the ellipsoid, at its radius across the meridian
    assert found["corners"][1][1] - longitude_deg == pytest.approx(7.02e-5, abs=2e-7)


def test_the_picture_is_reduced_and_kept(edge: Edge) -> None:
    picture = shown(edge, aerial(picture=field(size=(6000, 1500))))
    assert picture.size == (4096, 1024)
    assert is_near(picture.getpixel((5, 5)), *GREEN, 255)
    kept = list((edge.config.edge_dir / "orthophotos").iterdir())
    assert [each.suffix for each in kept] == [".webp"]


def test_a_changed_file_has_another_picture_and_tag(edge: Edge) -> None:
    path = put(edge, aerial())
    url = "/maps/north%20field.tif/picture"
    first = edge.ask("GET", url, "farmer")
    same = edge.ask("GET", url, "farmer", headers={"If-None-Match": first.headers["ETag"]})
    assert (same.status_code, same.data) == (304, b"")
    path.write_bytes(aerial(picture=field(size=(90, 40), colour=(200, 40, 40))))
    second = edge.ask("GET", url, "farmer", headers={"If-None-Match": first.headers["ETag"]})
    with Image.open(io.BytesIO(second.data)) as picture:
        assert is_near(picture.convert("RGB").getpixel((5, 5)), 200, 40, 40)


def test_pixels_without_a_value_are_transparent(edge: Edge) -> None:
    picture = field()
    picture.paste((0, 0, 0), (0, 0, 30, 40))
    found = shown(edge, aerial(picture=picture, tags={NO_DATA: "0"}))
    assert [found.getpixel((x, 20))[3] for x in (5, 55)] == [0, 255]  # type: ignore[index]


def test_a_vegetation_index_has_the_colours_of_its_values(edge: Edge) -> None:
    picture = field("F", colour=1.0)
    picture.paste(0.0, (0, 0, 20, 40))
    picture.paste(-9999.0, (20, 0, 40, 40))
    data = aerial(picture=picture, tags={NO_DATA: "-9999"}, compression="tiff_lzw")
    assert listed(edge, data)["kind"] == "vegetation_index"
    found = shown(edge, data)
    assert is_near(found.getpixel((5, 20)), 165, 0, 38, 255)
    assert found.getpixel((30, 20))[3] == 0  # type: ignore[index]
    assert is_near(found.getpixel((55, 20)), 26, 152, 80, 255)


def test_other_numbers_than_a_vegetation_index_are_refused(edge: Edge) -> None:
    url = listed(edge, aerial(picture=field("F", colour=612.0)))["url"]
    answer = edge.ask("GET", url, "farmer")
    assert answer.status_code == 404
    assert "one band with the value 612 is not supported" in (answer.json or {})["message"]


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        pytest.param(b"", "it is not a TIFF", id="empty"),
        pytest.param(b"\x89PNG\r\n\x1a\n", "it is not a TIFF", id="png"),
        pytest.param(aerial()[:40], "it is not a TIFF", id="cut off"),
        pytest.param(
            aerial(picture=field(size=(600, 400)))[:-1],
            "it is cut off: it has 720263 of 720264 bytes; copy it again",
            id="cut off at the end",
        ),
        pytest.param(b"II+\x00" + bytes(60), "BigTIFF is not supported", id="bigtiff"),
        pytest.param(aerial(without=[SCALE]), "it has no place", id="no scale"),
        pytest.param(aerial(without=[TIEPOINT]), "it has no place", id="no place"),
        pytest.param(
            aerial(without=[SCALE, TIEPOINT], tags={TRANSFORMATION: tuple(map(float, range(16)))}),
            "a turned grid (ModelTransformation) is not supported",
            id="turned",
        ),
        pytest.param(
            aerial(tags={TIEPOINT: tuple(map(float, range(12)))}),
            "several tie points are not supported",
            id="tie points",
        ),
        pytest.param(
            geotiff(field(), -416_000.0, 4_930_000.0, 0.1, utm(3857)),
            "its coordinates are in EPSG:3857, which is not supported",
            id="web mercator",
        ),
        pytest.param(
            geotiff(field(), 0.0, 0.0, 0.1, utm(32767)),
            "its coordinates are in a system without an EPSG code",
            id="own system",
        ),
        pytest.param(
            geotiff(field(), -200.0, 40.0, 0.1), "its corners are not on the earth", id="nowhere"
        ),
        pytest.param(aerial(picture=field("I;16", colour=0)), "1 bands of 16 bits", id="16 bits"),
        pytest.param(
            aerial(picture=field("1", (12_000, 9_000), 0), compression="group4"),
            "it has 12000 x 9000 pixels, more than 100 megapixels",
            id="too large",
        ),
    ],
)
def test_what_is_not_supported_is_named(edge: Edge, data: bytes, fault: str) -> None:
    found = listed(edge, data)
    assert found["fault"].startswith(fault)
    assert (found["kind"], found["url"]) == (None, None)
    assert edge.ask("GET", "/maps/north%20field.tif/picture", "farmer").status_code == 404


def test_a_damaged_picture_is_refused_alone(edge: Edge) -> None:
    data = aerial(picture=field(size=(600, 400)), compression="tiff_deflate")
    (offset,) = struct.unpack("<I", data[4:8])
    # The pixels lie before the directory of the tags, or after it
    damaged = data[:8] + bytes(200) + data[208:] if offset > 300 else data[:-200]
    answer = edge.ask("GET", listed(edge, damaged)["url"] or "/maps/x.tif/picture", "farmer")
    assert answer.status_code == 404
    assert "its pixels are damaged or cut off: copy it again" in answer.text
    put(edge, aerial(), "south.tif")
    assert edge.ask("GET", "/maps/south.tif/picture", "farmer").status_code == 200


def test_keys_of_the_tags_may_be_in_either_byte_order(edge: Edge) -> None:
    """A file as older programs write it, most significant byte first."""
    entries = [
        (256, 3, 1, struct.pack(">HH", 60, 0)),
        (257, 3, 1, struct.pack(">HH", 40, 0)),
        (258, 3, 1, struct.pack(">HH", 8, 0)),
        (SCALE, 12, 3, struct.pack(">I", 200)),
        (TIEPOINT, 12, 6, struct.pack(">I", 224)),
        (KEYS, 3, 8, struct.pack(">I", 272)),
    ]
    directory = struct.pack(">H", len(entries)) + b"".join(
        struct.pack(">HHI", *entry[:3]) + entry[3] for entry in entries
    )
    head = (b"MM\x00*" + struct.pack(">I", 8) + directory).ljust(200, b"\0")
    values = struct.pack(">9d", PIXEL_DEG, PIXEL_DEG, 0, 0, 0, 0, WEST, NORTH, 0)
    keys = struct.pack(">8H", 1, 1, 0, 1, 2048, 0, 1, 4326)
    assert listed(edge, head + values + keys)["corners"][0] == pytest.approx([NORTH, WEST])
