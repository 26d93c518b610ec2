"""Pictures from web servers, and pictures that are too large, hostile or no pictures at all."""

import base64
import io
import random
import struct
import threading
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest
from PIL import Image

from afarcloud import state
from afarcloud.enumerations import ImageFormat
from mavlink_broker.effects import ConvertedPicture, ConvertPicture, Downloaded, FetchUrl, JobFailed
from mavlink_broker.pictures.worker_pool import WorkerPool, format_of, run_job

LIMIT = state.MAXIMUM_FRAME_BYTES
XMP = b'<x:xmpmeta xmlns:x="adobe:ns:meta/"><GPSLatitude>40.4434</GPSLatitude></x:xmpmeta>'
LATITUDE = (40.0, 26.0, 36.24)
GPS_IFD, GPS_LATITUDE, SERIAL = 0x8825, 2, 0xA431


def noise(width: int, height: int) -> Image.Image:
    return Image.frombytes("RGB", (width, height), random.Random(1).randbytes(width * height * 3))


def large_jpeg(width: int = 1600, height: int = 1200) -> bytes:
    exif = Image.Exif()
    exif.get_ifd(GPS_IFD)[GPS_LATITUDE] = LATITUDE
    out = io.BytesIO()
    noise(width, height).save(out, "JPEG", quality=95, exif=exif.tobytes(), xmp=XMP)
    return out.getvalue()


def bomb(side: int) -> bytes:
    """A PNG of few bytes whose header gives a huge square."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return (
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        )

    header = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
    body = zlib.compress(b"\x00" * 100_000)
    filling = chunk(b"tEXt", b"k\x00" + b"x" * LIMIT)
    start = b"\x89PNG\r\n\x1a\n"
    return start + chunk(b"IHDR", header) + filling + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def converted(data: bytes) -> ConvertedPicture:
    outcome = run_job(ConvertPicture(1, data))
    assert isinstance(outcome, ConvertedPicture), outcome
    return outcome


def test_what_fits_is_passed_on_as_it_is() -> None:
    out = io.BytesIO()
    noise(64, 48).save(out, "PNG")
    picture = converted(out.getvalue())
    assert picture.format is ImageFormat.PNG
    assert base64.b64decode(picture.frame) == out.getvalue()
    assert picture.size_bytes == len(out.getvalue())


def test_what_is_too_large_is_made_to_fit_and_keeps_its_place() -> None:
    data = large_jpeg()
    assert len(data) > LIMIT
    picture = converted(data)
    frame = base64.b64decode(picture.frame)
    assert picture.format is ImageFormat.JPEG
    assert LIMIT // 4 < len(frame) == picture.size_bytes <= LIMIT
    smaller = Image.open(io.BytesIO(frame))
    assert smaller.getexif().get_ifd(GPS_IFD)[GPS_LATITUDE] == pytest.approx(LATITUDE)
    assert smaller.info["xmp"] == XMP
    fields = {"format": "jpeg", "image_size": picture.size_bytes, "frame": picture.frame}
    state.Image.model_validate({"sequence_number": 0, "vehicle_id": 1, **fields})


def test_an_unknown_format_becomes_a_jpeg() -> None:
    out = io.BytesIO()
    noise(64, 48).save(out, "BMP")
    assert converted(out.getvalue()).format is ImageFormat.JPEG


@pytest.mark.parametrize(
    "data",
    [
        b"<html>no picture</html>",
        b"\xff\xd8\xff" + b"\x00" * (LIMIT + 1),
        b"II*\x00" + b"\xff" * (LIMIT + 1),
        large_jpeg()[: LIMIT + 100],
        bomb(2**31 - 1),
        bomb(60_000),
        bomb(9_000),
    ],
    ids=["no picture", "empty jpeg", "bad tiff", "cut off", "huge bomb", "bomb", "small bomb"],
)
def test_hostile_pictures_are_refused_and_nothing_else_happens(data: bytes) -> None:
    outcome = run_job(ConvertPicture(7, data))
    assert isinstance(outcome, JobFailed)
    assert outcome.number == 7
    assert outcome.reason.startswith("it cannot be converted: ")
    assert "Traceback" not in outcome.reason
    assert " object at 0x" not in outcome.reason


def test_formats_are_recognised_by_their_first_bytes() -> None:
    assert format_of(b"\xff\xd8\xff\xe0") is ImageFormat.JPEG
    assert format_of(b"RIFF\x00\x00\x00\x00WEBPVP8 ") is ImageFormat.WEBP
    assert format_of(b"RIFF\x00\x00\x00\x00WAVEfmt ") is None
    assert format_of(b"") is None


class _Camera(BaseHTTPRequestHandler):
    """A camera's web server."""

    def do_GET(self) -> None:
        if self.path == "/elsewhere":
            self.send_response(302)
            self.send_header("Location", "/1.jpg")
            self.end_headers()
            return
        body = {"/1.jpg": b"picture", "/large": b"x" * 5000, "/empty": b""}.get(self.path)
        self.send_response(404 if body is None else 200)
        self.end_headers()
        self.wfile.write(body or b"")

    def log_message(self, *_: Any) -> None:
        """Keep quiet."""


@contextmanager
def web_camera() -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Camera)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def test_a_picture_is_downloaded_from_a_web_server() -> None:
    with web_camera() as url:
        assert run_job(FetchUrl(1, f"{url}/1.jpg", 1000)) == Downloaded(1, b"picture")


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("/2.jpg", "the web server answers HTTP 404"),
        ("/elsewhere", "the web server answers HTTP 302"),
        ("/large", "the answer is longer than 1000 bytes"),
        ("/empty", "it is empty"),
    ],
)
def test_a_failed_download_is_reported(path: str, reason: str) -> None:
    with web_camera() as url:
        assert run_job(FetchUrl(1, url + path, 1000)) == JobFailed(1, reason)


@pytest.mark.parametrize("url", ["http://127.0.0.1:1/1.jpg", "http://[::1", "http://"])
def test_a_missing_web_server_is_reported(url: str) -> None:
    outcome = run_job(FetchUrl(1, url, 1000))
    assert isinstance(outcome, JobFailed)
    assert outcome.reason.startswith("the download failed")


def test_jobs_are_done_beside_the_loop_which_is_woken() -> None:
    woken = threading.Event()
    worker_pool = WorkerPool(woken.set)
    worker_pool.start()
    out = io.BytesIO()
    noise(8, 8).save(out, "JPEG")
    worker_pool.put(3, ConvertPicture(9, out.getvalue()))
    assert woken.wait(60.0)
    ((system, outcome),) = worker_pool.take_finished()
    assert system == 3
    assert isinstance(outcome, ConvertedPicture)
    assert worker_pool.take_finished() == []
    worker_pool.stop()
