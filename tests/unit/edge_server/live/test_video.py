"""A camera is requested once for all who look, and only while somebody does."""

from collections.abc import Callable

import pytest

from edge_server.live import video
from edge_server.live.mjpeg import CONTENT_TYPE, FrameReader
from edge_server.live.video import Cameras, CameraState, TooManyViewersError, VideoStream
from tests.support.mjpeg_camera import MjpegCamera, jpeg, mjpeg_camera
from tests.support.polling import wait_until

VEHICLE = 7


def look(cameras: Cameras, is_admitted: Callable[[], bool] = lambda: True) -> VideoStream:
    stream = cameras.view(VEHICLE, is_admitted, 0.0)
    assert stream is not None
    return stream


def pictures(stream: VideoStream, now: float) -> list[bytes]:
    """Take what a viewer gets now."""
    data = stream.take(now)
    assert data is not None
    return FrameReader(CONTENT_TYPE).feed(data)


def state(cameras: Cameras) -> CameraState:
    return cameras.listing()[0].state


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video, "RETRY_S", 0.01)


def test_many_viewers_cost_the_camera_one_connection() -> None:
    with mjpeg_camera() as camera:
        cameras = Cameras({VEHICLE: camera.url})
        viewers = [look(cameras) for _ in range(8)]
        assert camera.requests == 0
        wait_until(lambda: pictures(viewers[0], 1.0) == [camera.frame])
        assert [pictures(one, 1.0) for one in viewers[1:]] == [[camera.frame]] * 7
        assert camera.requests == 1
        assert state(cameras) is CameraState.SHOWING


def test_a_viewer_gets_the_newest_picture_and_not_more_than_its_rate() -> None:
    with mjpeg_camera() as camera:
        cameras = Cameras({VEHICLE: camera.url})
        viewer = look(cameras)
        wait_until(lambda: pictures(viewer, 1.0) != [])
        camera.frame = jpeg((0, 0, 255))
        wait_until(lambda: cameras.listing() and newest(cameras) == camera.frame)
        assert pictures(viewer, 1.1) == []
        assert pictures(viewer, 1.3) == [camera.frame]


def newest(cameras: Cameras) -> bytes:
    return cameras._cameras[VEHICLE].newest[1]


def test_a_camera_is_left_alone_when_the_last_viewer_has_gone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(video, "LINGER_S", 0.2)
    with mjpeg_camera() as camera:
        cameras = Cameras({VEHICLE: camera.url})
        viewers = [look(cameras)]
        wait_until(lambda: pictures(viewers[0], 1.0) != [])
        viewers.clear()
        wait_until(lambda: camera.connected == 0)
        wait_until(lambda: state(cameras) is CameraState.IDLE)
        assert newest(cameras) == b""
        again = look(cameras)
        wait_until(lambda: pictures(again, 1.0) != [])


def test_the_answer_ends_with_the_session_and_without_pictures() -> None:
    cameras = Cameras({VEHICLE: "http://127.0.0.1:9/stream"})
    assert look(cameras, lambda: False).take(0.0) is None
    viewer = look(cameras)
    assert viewer.take(video.WAIT_FOR_PICTURE_S) == b""
    assert viewer.take(video.WAIT_FOR_PICTURE_S + 0.1) is None


def test_viewers_are_bounded_and_one_who_leaves_makes_room(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(video, "VIEWERS_MAX", 2)
    cameras = Cameras({VEHICLE: "http://127.0.0.1:9/"})
    viewers = [look(cameras), look(cameras)]
    with pytest.raises(TooManyViewersError, match="2 viewers"):
        look(cameras)
    viewers.pop()
    viewers.append(look(cameras))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"status": 404}, "404"),
        ({"content_type": "text/html"}, "not Motion JPEG"),
        ({"frame": b"<html>"}, "no JPEG"),
    ],
)
def test_a_camera_that_sends_something_else_is_named_and_tried_again(
    change: dict[str, object], reason: str
) -> None:
    with mjpeg_camera() as camera:
        usual = {name: getattr(camera, name) for name in change}
        set_all(camera, change)
        cameras = Cameras({VEHICLE: camera.url})
        viewer = look(cameras)
        viewer.take(0.0)
        wait_until(lambda: reason in (cameras.listing()[0].reason or ""))
        assert state(cameras) is CameraState.FAILED
        set_all(camera, usual)
        wait_until(lambda: pictures(viewer, 1.0) == [camera.frame])
        assert cameras.listing()[0].reason is None


def set_all(camera: MjpegCamera, values: dict[str, object]) -> None:
    for name, value in values.items():
        setattr(camera, name, value)


def test_a_camera_that_is_out_of_reach_holds_nobody_up() -> None:
    cameras = Cameras({VEHICLE: "http://127.0.0.1:9/stream"})
    viewer = look(cameras)
    assert viewer.take(0.0) == b""
    wait_until(lambda: state(cameras) is CameraState.FAILED)
    assert "refused" in (cameras.listing()[0].reason or "")


def test_a_vehicle_without_a_camera_has_no_picture() -> None:
    assert Cameras({}).view(VEHICLE, lambda: True, 0.0) is None
