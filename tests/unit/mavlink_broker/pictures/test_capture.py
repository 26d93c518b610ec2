"""Where a picture lies, as its announcement says."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.pictures.capture import FilePlace, Place, WebPlace, place_of, read_capture


@pytest.mark.parametrize(
    ("url", "place"),
    [
        ("mftp:///image/1.jpg", FilePlace("/image/1.jpg")),
        ("mftp://image/1.jpg", FilePlace("image/1.jpg")),
        ("mftp://[;comp=100]/image/1.jpg", FilePlace("/image/1.jpg", 100)),
        ("mftp://;comp=12/1.jpg", FilePlace("/1.jpg", 12)),
        ("mftp:///[;comp=7]/1.jpg", FilePlace("/1.jpg", 7)),
        ("/fs/microsd/image/1.jpg", FilePlace("/fs/microsd/image/1.jpg")),
        ("DCIM/100MEDIA/DJI_0001.JPG", FilePlace("DCIM/100MEDIA/DJI_0001.JPG")),
        ("http://192.168.1.9/1.jpg", WebPlace("http://192.168.1.9/1.jpg")),
        ("https://camera.local:8443/1.jpg", WebPlace("https://camera.local:8443/1.jpg")),
    ],
)
def test_every_spelling_is_a_place(url: str, place: Place) -> None:
    assert place_of(url) == place


@pytest.mark.parametrize(
    "url",
    [
        "",
        "mftp://",
        "mftp://[;comp=300]/1.jpg",
        "gopher://x/1",
        "http://",
        "http://[",
        "https:///1",
    ],
)
def test_what_is_no_place_is_none(url: str) -> None:
    assert place_of(url) is None


@given(st.text(max_size=205))
def test_whatever_is_written_is_a_place_or_none(url: str) -> None:
    place = place_of(url)
    if isinstance(place, FilePlace):
        assert place.path
        assert place.component is None or 1 <= place.component <= 255


def announcement(index: int, boot_ms: int, component: int = 100) -> Message:
    message = mavlink.MAVLink_camera_image_captured_message(
        boot_ms, 0, 0, 0, 0, 0, 5000, [1.0, 0.0, 0.0, 0.0], index, 1, b"/1.jpg"
    )
    (decoded,) = Decoder().decode(Encoder(1, component).encode(message))
    return decoded


def test_the_same_announcement_is_the_same_picture_and_no_other_is() -> None:
    identities = [
        read_capture(message).identity
        for message in (
            announcement(3, 9000),
            announcement(3, 9000),
            announcement(4, 9000),
            announcement(3, 9001),
            announcement(3, 9000, component=101),
        )
    ]
    assert identities[0] == identities[1]
    assert len(set(identities)) == 4


def test_a_camera_without_a_clock_tells_no_time() -> None:
    assert read_capture(announcement(0, 0)).taken_s is None
    assert read_capture(announcement(0, 1500)).taken_s == 1.5
