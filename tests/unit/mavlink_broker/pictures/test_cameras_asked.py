"""What the states of the cameras of one vehicle show about a command."""

from afarcloud.commands import CameraImage
from mavlink_broker.live.camera_state import (
    ANSWER_TIMEOUT_S,
    SERIES_EXTRA_S,
    SILENT_AFTER_S,
    CaptureCheck,
    CaptureState,
    SeriesMonitor,
)
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, Route, mavlink
from mavlink_broker.vehicle.vehicle import Vehicle

CREATE = mavlink.MAV_CMD_PANORAMA_CREATE
FIRST, SECOND = mavlink.MAV_COMP_ID_CAMERA, mavlink.MAV_COMP_ID_CAMERA2
BUSY, IDLE = 1, 0


def sent_by(component: int, message: Message) -> Message:
    """Pass a message over the wire."""
    (received,) = Decoder().decode(Encoder(1, component).encode(message))
    return received


def status(component: int, image_status: int) -> Message:
    message = mavlink.MAVLink_camera_capture_status_message(0, image_status, 0, 0.0, 0, 0.0)
    return sent_by(component, message)


def vehicle_with(*cameras: int) -> Vehicle:
    return Vehicle(1, Route(254, 191, 1, 1), cameras=set(cameras))


def test_an_idle_camera_does_not_end_the_command_of_another_one() -> None:
    check = CaptureCheck(CREATE, vehicle_with(FIRST, SECOND))
    states: list[CaptureState] = []
    working = mavlink.MAVLink_command_ack_message(CREATE, mavlink.MAV_RESULT_IN_PROGRESS)
    check.receive(sent_by(1, working), 0.0)
    assert len(check.tick(SILENT_AFTER_S)) == 2
    check.receive(status(SECOND, IDLE), 3.1)
    states.append(check.state)
    check.receive(status(FIRST, BUSY), 3.2)
    check.receive(status(SECOND, IDLE), 3.3)
    states.append(check.state)
    check.receive(status(FIRST, IDLE), 4.3)
    states.append(check.state)
    check.receive(sent_by(1, working), 5.0)
    states.append(check.state)
    in_progress = CaptureState.IN_PROGRESS
    assert states == [in_progress, in_progress, CaptureState.NOT_DONE, in_progress]


def captured(component: int) -> Message:
    """A picture, announced by a camera."""
    message = mavlink.MAVLink_camera_image_captured_message(
        0, 0, 0, 0, 0, 0, 0, [1.0, 0.0, 0.0, 0.0], 0, 1, b""
    )
    return sent_by(component, message)


def without_answer(worker: int, *, is_link_lost: bool = False) -> CaptureCheck:
    """Ask two cameras, of which the second is silent, for as long as it is waited for."""
    vehicle = vehicle_with(FIRST, SECOND)
    vehicle.snapshot.time_s = 0.0
    check = CaptureCheck(CREATE, vehicle)
    check.receive(captured(worker), 0.0)
    for second in range(1, int(SILENT_AFTER_S + ANSWER_TIMEOUT_S)):
        check.tick(second)
        if is_link_lost:
            check.restart_timeout()
        else:
            check.receive(status(FIRST, IDLE), second + 0.1)
        assert check.state is CaptureState.IN_PROGRESS
        assert check.fault(second + 0.2) is None
    return check


AT_LAST_S = SILENT_AFTER_S + ANSWER_TIMEOUT_S + 0.5


def test_a_silent_camera_that_was_working_fails_the_command() -> None:
    fault = without_answer(SECOND).fault(AT_LAST_S)
    assert fault is not None
    assert str(SECOND) in fault


def test_a_silent_camera_without_a_sign_of_work_is_ignored() -> None:
    check = without_answer(FIRST)
    assert check.fault(AT_LAST_S) is None
    assert check.state is CaptureState.DONE


def test_a_lost_link_restarts_the_timeout_of_the_cameras() -> None:
    assert without_answer(SECOND, is_link_lost=True).fault(AT_LAST_S) is None


def test_a_series_ends_though_the_vehicle_sends_its_time_late() -> None:
    picture = {"pitch_angle": 0.0}
    command = CameraImage.model_validate(
        {"command_id": 1, "command_type_id": 4, "parameters": picture}
    )
    vehicle = vehicle_with(FIRST)
    watch = SeriesMonitor(command, vehicle)
    began_at, time_s = 1000.0, 12.0
    watch.tick(began_at)
    within_s = SERIES_EXTRA_S + 1.0
    for second in range(1, int(within_s)):
        vehicle.snapshot.time_s = time_s + second
        watch.tick(began_at + second)
        watch.receive(status(FIRST, BUSY), began_at + second)
        assert not watch.is_over(began_at + second)
    vehicle.snapshot.time_s = time_s + within_s
    assert watch.is_over(began_at + within_s)
