"""MAVSDK's client takes pictures with the autopilot's camera component."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest
from mavsdk.plugins.action import Action
from mavsdk.plugins.camera import Camera, CameraError, CameraResult, Mode, PhotosRange
from mavsdk.plugins.gimbal import ControlMode, Gimbal, GimbalMode, SendMode
from mavsdk.plugins.telemetry import Telemetry

from tests.conformance.mavsdk_client import connected
from tests.support.system import wait_for

pytestmark = pytest.mark.scenario

SYSTEM = 6
SPEED = 5
CAMERA = 100


class Client(NamedTuple):
    """MAVSDK's plugins on one vehicle."""

    camera: Any
    gimbal: Any
    action: Any
    telemetry: Any
    captures: list[Any]


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    with connected(SYSTEM, SPEED, tmp_path_factory.mktemp("vehicle")) as system:
        captures: list[Any] = []
        made = Client(
            camera=Camera(system),
            gimbal=Gimbal(system),
            action=Action(system),
            telemetry=Telemetry(system),
            captures=captures,
        )
        made.camera.subscribe_capture_info(
            lambda capture, _user_data=None: captures.append(capture)
        )
        wait_for(lambda: made.camera.camera_list().cameras, "MAVSDK's discovery of the camera")
        wait_for(lambda: made.gimbal.gimbal_list().gimbals, "MAVSDK's discovery of the gimbal")
        yield made


def more_captures(client: Client, before: int, count: int) -> list[Any]:
    wait_for(lambda: len(client.captures) >= before + count, f"{count} pictures")
    return client.captures[before:]


def test_the_camera_reports_its_information(client: Client) -> None:
    (camera,) = client.camera.camera_list().cameras
    assert camera.component_id == CAMERA
    assert camera.horizontal_resolution_px == 2048
    assert camera.vertical_resolution_px == 1536
    assert camera.focal_length_mm == pytest.approx(4.5)


def test_a_photo_is_taken_and_reported_with_its_position(client: Client) -> None:
    before = len(client.captures)
    client.camera.take_photo(CAMERA)
    capture = more_captures(client, before, 1)[0]
    assert capture.is_success
    assert capture.position.latitude_deg == pytest.approx(40.4434, abs=1e-4)
    assert capture.position.longitude_deg == pytest.approx(-3.7382, abs=2e-4)
    assert capture.position.absolute_altitude_m == pytest.approx(650.0, abs=10.0)
    assert capture.time_utc_us > 0


def series_begun(client: Client) -> bool:
    """Whether a series is taken now; while the shutter of a picture before moves it is not."""
    try:
        client.camera.start_photo_interval(CAMERA, 1.0)
    except CameraError:
        return False
    return True


def test_photos_at_an_interval_are_numbered_without_gaps_and_listed(client: Client) -> None:
    before = len(client.captures)
    wait_for(lambda: series_begun(client), "the series")
    try:
        more_captures(client, before, 3)
        with pytest.raises(CameraError):  # Busy, which MAVSDK calls denied
            client.camera.take_photo(CAMERA)
    finally:
        client.camera.stop_photo_interval(CAMERA)
    photos = client.camera.list_photos(CAMERA, PhotosRange.ALL)
    indices = [photo.index for photo in photos]
    assert indices == list(range(len(indices)))
    assert len(indices) >= before + 3


def test_video_is_recorded_and_its_duration_reported(client: Client) -> None:
    camera = client.camera
    camera.start_video(CAMERA)
    wait_for(lambda: camera.get_storage(CAMERA).video_on, "a recording camera")
    wait_for(lambda: camera.get_storage(CAMERA).recording_time_s > 1.0, "a second of video")
    camera.stop_video(CAMERA)
    wait_for(lambda: not camera.get_storage(CAMERA).video_on, "a camera at rest")


def test_the_mode_is_set_and_reported(client: Client) -> None:
    camera = client.camera
    camera.set_mode(CAMERA, Mode.VIDEO)
    wait_for(lambda: Mode(camera.get_mode(CAMERA)) is Mode.VIDEO, "video mode")
    camera.set_mode(CAMERA, Mode.PHOTO)
    wait_for(lambda: Mode(camera.get_mode(CAMERA)) is Mode.PHOTO, "photo mode")
    camera.set_mode(CAMERA, Mode.VIDEO)
    camera.reset_settings(CAMERA)
    wait_for(lambda: Mode(camera.get_mode(CAMERA)) is Mode.PHOTO, "the first mode again")


@pytest.mark.parametrize(
    "call",
    [
        lambda camera: camera.zoom_in_start(CAMERA),
        lambda camera: camera.focus_in_start(CAMERA),
    ],
    ids=["zoom", "focus"],
)
def test_an_absent_camera_feature_is_unsupported(client: Client, call: Any) -> None:
    with pytest.raises(CameraError) as refused:
        call(client.camera)
    assert refused.value.args[0] == CameraResult.ACTION_UNSUPPORTED


def from_above(captures: list[Any]) -> list[Any]:
    """Those that were not taken on the ground."""
    return [each for each in captures if each.position.relative_altitude_m > 5.0]


def test_a_flying_camera_tracks_the_ground_but_not_the_sky(client: Client) -> None:
    action, telemetry, gimbal = client.action, client.telemetry, client.gimbal
    (found,) = gimbal.gimbal_list().gimbals
    action.set_takeoff_altitude(10.0)
    action.arm()
    action.takeoff()
    wait_for(lambda: telemetry.position().relative_altitude_m > 9.0, "10 m height")
    with pytest.raises(CameraError):
        client.camera.track_point(CAMERA, 0.5, 0.2, 0.1)
    client.camera.track_rectangle(CAMERA, 0.6, 0.85, 0.7, 0.95)
    wait_for(
        lambda: gimbal.get_attitude(found.gimbal_id).euler_angle_north.pitch_deg < -10.0,
        "a gimbal that looks down at its target",
    )
    client.camera.track_stop(CAMERA)
    gimbal.take_control(found.gimbal_id, ControlMode.PRIMARY)
    gimbal.set_angles(found.gimbal_id, 0.0, -90.0, 0.0, GimbalMode.YAW_FOLLOW, SendMode.ONCE)
    wait_for(
        lambda: gimbal.get_attitude(found.gimbal_id).euler_angle_north.pitch_deg < -89.0,
        "a gimbal that looks straight down",
    )
    before = len(client.captures)
    client.camera.take_photo(CAMERA)
    # Pictures that were taken on the ground may still be on their way to the card
    wait_for(lambda: from_above(client.captures[before:]), "the picture from above")
    capture = from_above(client.captures[before:])[0]
    assert capture.position.relative_altitude_m == pytest.approx(10.0, abs=1.5)
    q = capture.attitude_quaternion
    down = 2.0 * (q.x * q.z - q.w * q.y)  # Third component of the optical axis in NED
    assert math.degrees(math.asin(max(-1.0, min(1.0, down)))) == pytest.approx(90.0, abs=2.0)
    action.land()
    wait_for(lambda: not telemetry.armed(), "disarmed")


def formatted(camera: Any) -> bool:
    """Whether the storage is formatted; while a picture is being stored it is not."""
    try:
        camera.format_storage(CAMERA, 1)
    except CameraError:
        return False
    return True


def test_the_storage_is_formatted_and_the_numbers_begin_again(client: Client) -> None:
    camera = client.camera
    wait_for(lambda: formatted(camera), "a format, once every picture is stored")
    before = len(client.captures)
    camera.take_photo(CAMERA)
    assert more_captures(client, before, 1)[0].index == 0
    wait_for(lambda: 0.0 < camera.get_storage(CAMERA).used_storage_mib < 5.0, "one picture's room")
    assert camera.get_storage(CAMERA).total_storage_mib == 16384.0
