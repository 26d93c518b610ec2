"""Thumbnails of pictures over HTTP: small, made once, and refused for what is no picture."""

import base64
import io
import random
import struct
import subprocess
import sys
import threading
import zlib

import pytest
from PIL import Image

from edge_server.pictures import thumbnails
from tests.unit.edge_server.archive.flown import begin, send
from tests.unit.edge_server.conftest import Edge

URL = "/flights/1/pictures/{}/thumbnail"


def encoded(width: int, height: int, form: str = "JPEG", **options: object) -> bytes:
    """A picture of one colour."""
    out = io.BytesIO()
    Image.new("RGB", (width, height), (40, 120, 60)).save(out, form, **options)
    return out.getvalue()


def noise() -> bytes:
    """A picture that does not become small by its encoding."""
    out = io.BytesIO()
    data = random.Random(1).randbytes(640 * 480 * 3)
    Image.frombytes("RGB", (640, 480), data).save(out, "JPEG", quality=90)
    return out.getvalue()


def png_bomb(side: int) -> bytes:
    """A PNG of few bytes whose header gives a huge square."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        checksum = struct.pack(">I", zlib.crc32(kind + body))
        return struct.pack(">I", len(body)) + kind + body + checksum

    header = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
    pixels = zlib.compress(b"\x00" * 100_000)
    start = b"\x89PNG\r\n\x1a\n"
    return start + chunk(b"IHDR", header) + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")


def jpeg_bomb() -> bytes:
    """A small JPEG whose header gives 65,000 pixels each way."""
    data = encoded(16, 16)
    at = data.index(b"\xff\xc0")
    return data[: at + 5] + struct.pack(">HH", 65_000, 65_000) + data[at + 9 :]


def take(edge: Edge, *pictures: bytes, form: str = "jpeg") -> None:
    """Fly a mission with these pictures."""
    begin(edge)
    for number, data in enumerate(pictures):
        frame = base64.b64encode(data).decode()
        fields = {"image_size": len(data), "frame": frame, "format": form}
        send(edge, "image", sequence_number=number, **fields)


def size_of(data: bytes) -> tuple[int, int]:
    with Image.open(io.BytesIO(data)) as picture:
        assert picture.format == "JPEG"
        return picture.size


def test_a_thumbnail_is_a_small_jpeg_of_the_same_shape(edge: Edge) -> None:
    take(edge, encoded(4000, 3000))
    (picture,) = edge.get("/flights/1/pictures")
    assert picture["thumbnail_url"] == URL.format(1)
    answer = edge.ask("GET", picture["thumbnail_url"], "farmer")
    assert (answer.status_code, answer.content_type) == (200, "image/jpeg")
    assert size_of(answer.data) == (320, 240)


def test_a_small_picture_is_not_made_larger(edge: Edge) -> None:
    take(edge, encoded(64, 48))
    assert size_of(edge.ask("GET", URL.format(1), "farmer").data) == (64, 48)


@pytest.mark.parametrize("form", ["png", "tiff", "webp"])
def test_other_formats_have_thumbnails_too(edge: Edge, form: str) -> None:
    take(edge, encoded(640, 480, form.upper()), form=form)
    assert size_of(edge.ask("GET", URL.format(1), "farmer").data) == (320, 240)


def test_a_raw_picture_has_none(edge: Edge) -> None:
    take(edge, b"II*\x00 raw", form="dng")
    assert edge.get("/flights/1/pictures")[0]["thumbnail_url"] is None


def test_a_picture_that_was_taken_on_its_side_is_upright(edge: Edge) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6  # Turn by 90 degrees
    take(edge, encoded(640, 480, exif=exif.tobytes()))
    assert size_of(edge.ask("GET", URL.format(1), "farmer").data) == (240, 320)


def test_a_caller_that_has_it_receives_304(edge: Edge) -> None:
    take(edge, encoded(640, 480), encoded(640, 480))
    tags = [edge.ask("GET", URL.format(n), "farmer").headers["ETag"] for n in (1, 2)]
    assert tags[0] != tags[1]
    again = edge.ask("GET", URL.format(1), "farmer", headers={"If-None-Match": tags[0]})
    assert (again.status_code, again.data, again.headers["ETag"]) == (304, b"", tags[0])
    assert again.headers["Cache-Control"] == "private, no-cache"


@pytest.mark.parametrize(
    ("form", "data"),
    [
        pytest.param("jpeg", b"\xff\xd8\xff\xe0 a very small picture", id="no picture"),
        pytest.param("jpeg", noise()[:4000], id="cut off"),
        pytest.param("jpeg", jpeg_bomb(), id="jpeg bomb"),
        pytest.param("png", png_bomb(6000), id="png of too many pixels"),
        pytest.param("png", png_bomb(40_000), id="png bomb"),
    ],
)
def test_a_hostile_picture_has_none_and_others_keep_theirs(
    edge: Edge, form: str, data: bytes
) -> None:
    take(edge, data, encoded(640, 480, form.upper()), form=form)
    refused = edge.ask("GET", URL.format(1), "farmer")
    assert refused.status_code == 404
    message = (refused.json or {})["message"]
    assert message.startswith("picture 1 of flight 1 has no thumbnail: ")
    assert "Traceback" not in message
    assert " object at 0x" not in message
    assert edge.ask("GET", URL.format(2), "farmer").status_code == 200
    assert edge.ask("GET", "/flights/1/pictures/1", "farmer").data == data


def test_a_picture_that_is_not_there_is_404(edge: Edge) -> None:
    take(edge, encoded(64, 48))
    assert edge.ask("GET", URL.format(2), "farmer").status_code == 404
    assert edge.ask("GET", "/flights/2/pictures/1/thumbnail", "farmer").status_code == 404


def test_a_picture_that_takes_long_delays_no_other_request(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    take(edge, encoded(64, 48), encoded(64, 48))
    begun, go_on = threading.Event(), threading.Event()
    make = thumbnails._reduce

    def slowly(data: bytes) -> bytes:
        begun.set()
        assert go_on.wait(30.0)
        return make(data)

    monkeypatch.setattr(thumbnails, "_reduce", slowly)
    monkeypatch.setattr(thumbnails, "PATIENCE_S", 0.0)
    statuses: list[int] = []
    first = threading.Thread(
        target=lambda: statuses.append(edge.ask("GET", URL.format(1), "farmer").status_code)
    )
    first.start()
    assert begun.wait(30.0)
    refused = edge.ask("GET", URL.format(2), "farmer")
    go_on.set()
    first.join(30.0)
    assert (refused.status_code, refused.headers["Retry-After"]) == (429, "1")
    assert statuses == [200]
    assert edge.ask("GET", URL.format(2), "farmer").status_code == 200


def test_the_edge_server_does_not_load_the_library_of_pictures() -> None:
    code = "import sys, edge_server.app; sys.exit('PIL' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
