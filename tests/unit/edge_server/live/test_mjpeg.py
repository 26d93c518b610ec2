"""The pictures of a camera are found however its answer is cut, and nothing else is."""

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from edge_server.live import mjpeg
from edge_server.live.mjpeg import FrameError, FrameReader, part_of


def jpeg(shade: int) -> bytes:
    out = io.BytesIO()
    Image.new("L", (8, 8), shade).save(out, "JPEG")
    return out.getvalue()


FRAMES = [jpeg(shade) for shade in (0, 120, 240)]


def parts(*, length: bool, line: bytes, boundary: bytes = b"frame") -> bytes:
    found = b""
    for frame in FRAMES:
        size = b"content-LENGTH: %d" % len(frame) + line if length else b""
        found += b"--" + boundary + line + b"Content-Type: image/jpeg" + line + size + line
        found += frame + line
    return found + b"--" + boundary + line


@given(st.booleans(), st.sampled_from([b"\r\n", b"\n"]), st.integers(1, 200))
def test_pictures_are_found_however_the_answer_is_cut(length: bool, line: bytes, size: int) -> None:
    data = parts(length=length, line=line)
    reader = FrameReader('multipart/x-mixed-replace; boundary="frame"')
    found: list[bytes] = []
    for start in range(0, len(data), size):
        found += reader.feed(data[start : start + size])
    assert found == FRAMES


@pytest.mark.parametrize("declared", ["frame", "--frame"])
def test_a_boundary_may_have_its_dashes_in_the_header(declared: str) -> None:
    reader = FrameReader(f"multipart/x-mixed-replace;boundary={declared}")
    assert reader.feed(parts(length=True, line=b"\r\n")) == FRAMES


def test_what_is_encoded_for_a_viewer_is_read_again() -> None:
    reader = FrameReader(mjpeg.CONTENT_TYPE)
    assert reader.feed(b"".join(map(part_of, FRAMES))) == FRAMES


@pytest.mark.parametrize("content_type", ["", "text/html", "multipart/x-mixed-replace"])
def test_another_content_type_is_refused(content_type: str) -> None:
    with pytest.raises(FrameError, match="not Motion JPEG"):
        FrameReader(content_type)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"x" * 5000, "no delimiter"),
        (b"--frame\r\n" + b"x: y\r\n" * 1000, "no end"),
        (b"--frame\r\n\r\n<html>\r\n--frame", "no JPEG"),
        (b"--frame\r\nContent-Length: 999999999\r\n\r\n", "larger"),
        (b"--frame\r\n\r\n" + b"\xff\xd8" * mjpeg.LARGEST_FRAME_BYTES, "larger"),
    ],
)
def test_what_has_no_bound_or_is_no_picture_is_refused(data: bytes, reason: str) -> None:
    reader = FrameReader(mjpeg.CONTENT_TYPE)
    with pytest.raises(FrameError, match=reason):
        reader.feed(data)
