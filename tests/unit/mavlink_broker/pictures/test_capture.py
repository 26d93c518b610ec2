"""Position of a picture, from its CAMERA_IMAGE_CAPTURED."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.pictures.announcements import (
    FileLocation,
    Location,
    WebLocation,
    location_of,
    read_capture,
)


@pytest.mark.parametrize(
    ("url", "place"),
    [
        ("mftp:///image/1.jpg", FileLocation("/image/1.jpg")),
        ("mftp://image/1.jpg", FileLocation("image/1.jpg")),
        ("mftp://[;comp=100]/image/1.jpg", FileLocation("/image/1.jpg", 100)),
        ("mftp://;comp=12/1.jpg", FileLocation("/1.jpg", 12)),
        ("mftp:///[;comp=7]/1.jpg", FileLocation("/1.jpg", 7)),
        ("/fs/microsd/image/1.jpg", FileLocation("/fs/microsd/image/1.jpg")),
        ("DCIM/100MEDIA/DJI_0001.JPG", FileLocation("DCIM/100MEDIA/DJI_0001.JPG")),
        ("http://192.168.1.9/1.jpg", WebLocation("http://192.168.1.9/1.jpg")),
        ("https://camera.local:8443/1.jpg", WebLocation("https://camera.local:8443/1.jpg")),
    ],
)
def test_every_form_of_url_is_a_location(url: str, place: Location) -> None:
    assert location_of(url) == place


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
def test_an_invalid_url_is_no_location(url: str) -> None:
    assert location_of(url) is None


@given(st.text(max_size=205))
def test_any_url_is_a_location_or_none(url: str) -> None:
    place = location_of(url)
    if isinstance(place, FileLocation):
        assert place.path
        assert place.component is None or 1 <= place.component <= 255


def announcement(index: int, boot_ms: int, component: int = 100) -> Message:
    message = mavlink.MAVLink_camera_image_captured_message(
        boot_ms, 0, 0, 0, 0, 0, 5000, [1.0, 0.0, 0.0, 0.0], index, 1, b"/1.jpg"
    )
    (decoded,) = Decoder().decode(Encoder(1, component).encode(message))
    return decoded


def test_only_equal_announcements_have_the_same_identity() -> None:
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


def test_a_camera_without_a_clock_sends_no_time() -> None:
    assert read_capture(announcement(0, 0)).taken_s is None
    assert read_capture(announcement(0, 1500)).taken_s == 1.5
