"""QGroundControl's way of finding a camera and a gimbal, replayed to the autopilot process.

It asks each camera component for CAMERA_INFORMATION at 0, 2, 6, 14 and 30 s, by REQUEST_MESSAGE and
by the older command in turn, until it has it, and the autopilot six times, a second apart, for
GIMBAL_MANAGER_INFORMATION; then for settings, storage and status. Its plan view's own commands
follow. Every request has to be answered each time, because any answer may be lost.
"""

from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mavlink

from tests.conformance.ground_station import GroundStation, vehicle_process
from tests.support.system import free_ports

pytestmark = pytest.mark.scenario

VEHICLE, AUTOPILOT, CAMERA = 9, 1, 100
ACCEPTED = 0
ASKING_TIMES_S = (0.0, 2.0, 6.0, 14.0, 30.0)
SPEED = 10


@pytest.fixture(scope="module")
def station(tmp_path_factory: pytest.TempPathFactory) -> Iterator[GroundStation]:
    own, broker, ground = free_ports(3)
    state = tmp_path_factory.mktemp("vehicle")
    with vehicle_process(VEHICLE, SPEED, (own, broker, ground), state):
        made = GroundStation(ground, own, VEHICLE, (AUTOPILOT, CAMERA))
        made.until(lambda m: m.get_type() == "LOCAL_POSITION_NED", "a vehicle that knows its place")
        made.until(lambda m: m.get_type() == "ATTITUDE", "its time")
        yield made
        made.close()


def order(number: int, *parameters: float, component: int = CAMERA) -> Any:
    p = [*parameters, *[0.0] * (7 - len(parameters))]
    return mavlink.MAVLink_command_long_message(VEHICLE, component, number, 0, *p)


def answered(station: GroundStation, message: Any, wanted: str | None) -> tuple[int, Any]:
    """Result of a command and the message that it asked for, in whichever order they come."""
    result: int | None = None
    got: Any = None
    station.say(message)

    def done(received: Any) -> bool:
        nonlocal result, got
        if received.get_srcComponent() != message.target_component:
            return False
        if received.get_type() == "COMMAND_ACK" and received.command == message.command:
            result = received.result
        if received.get_type() == wanted:
            got = received
        return result is not None and (wanted is None or got is not None)

    station.until(done, f"{wanted} and an answer to {message.command}")
    assert result is not None
    return result, got


def vehicle_s(station: GroundStation) -> float:
    return float(station.newest["ATTITUDE"].time_boot_ms) / 1e3


def wait_until(station: GroundStation, time_s: float) -> None:
    station.until(lambda _message: vehicle_s(station) >= time_s, f"{time_s} s")


def test_the_camera_is_seen_by_its_heartbeat(station: GroundStation) -> None:
    beat = station.until(
        lambda m: m.get_type() == "HEARTBEAT" and m.get_srcComponent() == CAMERA, "the camera"
    )
    assert beat.type == mavlink.MAV_TYPE_CAMERA
    assert beat.autopilot == mavlink.MAV_AUTOPILOT_INVALID


def test_every_attempt_to_find_the_camera_is_answered(station: GroundStation) -> None:
    begin_s = vehicle_s(station)
    for attempt, time_s in enumerate(ASKING_TIMES_S):
        wait_until(station, begin_s + time_s)
        request = order(521, 1.0) if attempt % 2 else order(512, 259.0)
        result, information = answered(station, request, "CAMERA_INFORMATION")
        assert result == ACCEPTED
        assert information.flags & mavlink.CAMERA_CAP_FLAGS_CAPTURE_IMAGE
        assert information.flags & mavlink.CAMERA_CAP_FLAGS_HAS_VIDEO_STREAM
        assert not information.flags & mavlink.CAMERA_CAP_FLAGS_HAS_BASIC_ZOOM


def test_every_attempt_to_find_the_gimbal_is_answered(station: GroundStation) -> None:
    for _ in range(6):
        request = order(512, 280.0, component=AUTOPILOT)
        result, information = answered(station, request, "GIMBAL_MANAGER_INFORMATION")
        assert result == ACCEPTED
        assert information.gimbal_device_id == 1
    attitude = station.until(
        lambda m: m.get_type() == "GIMBAL_DEVICE_ATTITUDE_STATUS", "the gimbal's attitude"
    )
    assert attitude.get_srcComponent() == AUTOPILOT
    station.until(lambda m: m.get_type() == "GIMBAL_MANAGER_STATUS", "who is in control")


@pytest.mark.parametrize(
    ("number", "parameters", "name"),
    [
        (512, (260.0,), "CAMERA_SETTINGS"),
        (512, (261.0,), "STORAGE_INFORMATION"),
        (512, (262.0,), "CAMERA_CAPTURE_STATUS"),
        (522, (1.0,), "CAMERA_SETTINGS"),
        (525, (0.0, 1.0), "STORAGE_INFORMATION"),
        (527, (1.0,), "CAMERA_CAPTURE_STATUS"),
    ],
)
def test_settings_storage_and_status_are_reported(
    station: GroundStation, number: int, parameters: tuple[float, ...], name: str
) -> None:
    result, message = answered(station, order(number, *parameters), name)
    assert result == ACCEPTED
    assert message is not None


@pytest.mark.parametrize("request_of", [order(512, 269.0), order(2504, 0.0)])
def test_the_live_view_is_reported_with_its_address(
    station: GroundStation, request_of: Any
) -> None:
    result, stream = answered(station, request_of, "VIDEO_STREAM_INFORMATION")
    assert result == ACCEPTED
    assert (stream.stream_id, stream.count) == (1, 1)
    assert stream.uri.startswith(("http://", "rtsp://"))


def test_the_shutter_of_the_fly_view_gives_a_marker_on_the_map(station: GroundStation) -> None:
    result, marker = answered(station, order(2000, 0.0, 0.0, 1.0, 1.0), "CAMERA_IMAGE_CAPTURED")
    assert result == ACCEPTED
    assert marker.capture_result == 1
    assert marker.lat == pytest.approx(404_434_000, abs=1000)


def test_a_change_of_mode_is_reported_and_reverted(station: GroundStation) -> None:
    result, settings = answered(station, order(530, 0.0, 2.0), "CAMERA_SETTINGS")
    assert (result, settings.mode_id) == (ACCEPTED, mavlink.CAMERA_MODE_IMAGE_SURVEY)
    result, settings = answered(station, order(529, 1.0), "CAMERA_SETTINGS")
    assert (result, settings.mode_id) == (ACCEPTED, mavlink.CAMERA_MODE_IMAGE)
