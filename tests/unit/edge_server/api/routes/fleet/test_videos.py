"""The live picture of a vehicle's camera is for the people of the farm."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from edge_server.api.routes.fleet import videos
from edge_server.config import ConfigError, load
from edge_server.live.video import Cameras
from tests.support.mjpeg_camera import MjpegCamera, mjpeg_camera
from tests.support.polling import wait_until
from tests.unit.edge_server.conftest import Edge


@pytest.fixture
def camera() -> Iterator[MjpegCamera]:
    with mjpeg_camera() as one:
        yield one


def fit(edge: Edge, camera: MjpegCamera) -> None:
    edge.client.application.extensions[videos.EXTENSION] = Cameras({1: camera.url})


def test_cameras_are_listed_with_their_address(edge: Edge, camera: MjpegCamera) -> None:
    assert edge.get("/videos/") == []
    fit(edge, camera)
    (one,) = edge.get("/videos/")
    assert one == {"vehicle_id": 1, "url": "/videos/1/", "state": "idle", "reason": None}


def test_a_person_receives_pictures(edge: Edge, camera: MjpegCamera) -> None:
    fit(edge, camera)

    def body() -> bytes:
        answer = edge.ask("GET", "/videos/1", "farmer")
        assert answer.status_code == 200
        assert answer.content_type.startswith("multipart/x-mixed-replace")
        return bytes(answer.data)

    wait_until(lambda: camera.frame in body())


@pytest.mark.parametrize(("role", "status"), [(None, 401), ("broker", 403)])
def test_nobody_else_does(edge: Edge, camera: MjpegCamera, role: str | None, status: int) -> None:
    fit(edge, camera)
    assert edge.ask("GET", "/videos/1", role).status_code == status
    assert camera.requests == 0


def test_a_vehicle_without_a_camera_says_which_setting_names_one(edge: Edge) -> None:
    answer = edge.ask("GET", "/videos/9", "operator")
    assert answer.status_code == 404
    assert "VIDEO_STREAMS" in answer.get_data(as_text=True)


def test_the_setting_names_vehicles_and_addresses() -> None:
    text = "2=https://camera/two?x=1, 1=http://10.0.0.7:8080/stream"
    found = load({}, {"VIDEO_STREAMS": text})
    assert dict(found.video_streams) == {
        1: "http://10.0.0.7:8080/stream",
        2: "https://camera/two?x=1",
    }


def test_a_file_of_settings_may_write_a_table(tmp_path: Path) -> None:
    file = tmp_path / "edge.toml"
    file.write_text('[edge_server.video_streams]\n3 = "http://camera/three"\n')
    assert load({}, {}, file).video_streams == ((3, "http://camera/three"),)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("1", "address of vehicle 1"),
        ("one=http://camera/", "vehicle=address"),
        ("1=http://a/,1=http://b/", "once"),
        ("1=file:///etc/passwd", "http or https"),
        ("1=http://user:secret@camera/", "user or a password"),
    ],
)
def test_a_wrong_setting_is_refused_with_its_reason(text: str, reason: str) -> None:
    with pytest.raises(ConfigError, match=f"VIDEO_STREAMS: .*{reason}"):
        load({}, {"VIDEO_STREAMS": text})
