"""What is concluded from the states that the cameras of one vehicle tell."""

from afarcloud.commands import CameraImage
from mavlink_broker.live.capture_check import PATIENCE_S, SILENT_AFTER_S, CaptureJudge, Verdict
from mavlink_broker.live.series_monitor import PATIENCE_S as SERIES_PATIENCE_S
from mavlink_broker.live.series_monitor import SeriesWatch
from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
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


def test_an_idle_camera_says_nothing_of_another_one_at_work() -> None:
    judge = CaptureJudge(CREATE, vehicle_with(FIRST, SECOND))
    verdicts: list[Verdict] = []
    working = mavlink.MAVLink_command_ack_message(CREATE, mavlink.MAV_RESULT_IN_PROGRESS)
    judge.receive(sent_by(1, working), 0.0)
    assert len(judge.tick(SILENT_AFTER_S)) == 2
    judge.receive(status(SECOND, IDLE), 3.1)
    verdicts.append(judge.verdict)
    judge.receive(status(FIRST, BUSY), 3.2)
    judge.receive(status(SECOND, IDLE), 3.3)
    verdicts.append(judge.verdict)
    judge.receive(status(FIRST, IDLE), 4.3)
    verdicts.append(judge.verdict)
    judge.receive(sent_by(1, working), 5.0)
    verdicts.append(judge.verdict)
    at_work = Verdict.AT_WORK
    assert verdicts == [at_work, at_work, Verdict.NOTHING_DONE, at_work]


def captured(component: int) -> Message:
    """A picture, announced by a camera."""
    message = mavlink.MAVLink_camera_image_captured_message(
        0, 0, 0, 0, 0, 0, 0, [1.0, 0.0, 0.0, 0.0], 0, 1, b""
    )
    return sent_by(component, message)


def asked_in_vain(worker: int, *, link_is_away: bool = False) -> CaptureJudge:
    """Ask two cameras, of which the second is silent, for as long as it is waited for."""
    vehicle = vehicle_with(FIRST, SECOND)
    vehicle.snapshot.time_s = 0.0
    judge = CaptureJudge(CREATE, vehicle)
    judge.receive(captured(worker), 0.0)
    for second in range(1, int(SILENT_AFTER_S + PATIENCE_S)):
        judge.tick(second)
        if link_is_away:
            judge.rest()
        else:
            judge.receive(status(FIRST, IDLE), second + 0.1)
        assert judge.verdict is Verdict.AT_WORK
        assert judge.fault(second + 0.2) is None
    return judge


AT_LAST_S = SILENT_AFTER_S + PATIENCE_S + 0.5


def test_a_silent_camera_that_was_at_work_fails_the_order() -> None:
    fault = asked_in_vain(SECOND).fault(AT_LAST_S)
    assert fault is not None
    assert str(SECOND) in fault


def test_a_silent_camera_that_showed_no_sign_of_work_is_not_waited_for() -> None:
    judge = asked_in_vain(FIRST)
    assert judge.fault(AT_LAST_S) is None
    assert judge.verdict is Verdict.DONE


def test_no_camera_is_blamed_for_a_link_that_is_away() -> None:
    assert asked_in_vain(SECOND, link_is_away=True).fault(AT_LAST_S) is None


def test_a_series_has_an_end_though_the_vehicle_tells_its_time_late() -> None:
    picture = {"pitch_angle": 0.0}
    command = CameraImage.model_validate(
        {"command_id": 1, "command_type_id": 4, "parameters": picture}
    )
    vehicle = vehicle_with(FIRST)
    watch = SeriesWatch(command, vehicle)
    began_at, time_s = 1000.0, 12.0
    watch.tick(began_at)
    within_s = SERIES_PATIENCE_S + 1.0
    for second in range(1, int(within_s)):
        vehicle.snapshot.time_s = time_s + second
        watch.tick(began_at + second)
        watch.receive(status(FIRST, BUSY), began_at + second)
        assert not watch.is_over(began_at + second)
    vehicle.snapshot.time_s = time_s + within_s
    assert watch.is_over(began_at + within_s)
