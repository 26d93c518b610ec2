"""What a vehicle does while its camera tracks a subject, by the track mode."""

import dataclasses
import itertools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import EventType, Status, TrackMode
from afarcloud.geodesy import offset, shifted
from mavlink_broker.mavlink.codec import Encoder
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.broker_world import World, go_home, mission, takeoff
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_FOLLOW,
    HOME,
    PX4,
    PX4_FOLLOW,
    PX4_HOLD,
    PX4_LAND,
    PX4_ORBIT,
    PX4_POSITION,
    Script,
)

ACTIVE, IDLE = 1, 0
NOWHERE = 2**31 - 1
SUBJECT_M = 20.0
CAMERA = mavlink.MAV_COMP_ID_CAMERA


class Scene:
    """A vehicle whose camera tracks something to its east that walks north."""

    def __init__(
        self, mode: TrackMode, script: Script = PX4, *, journal: Path | None = None
    ) -> None:
        self.world = World(journal=journal)
        self.vehicle = self.world.add_vehicle(script=script)
        self._camera = Encoder(1, CAMERA)
        self._walked_m = 0.0
        self.speed_m_s = 1.0
        self.sends_position = True
        self.world.edge.plan(mission(takeoff(), track(mode), go_home(3)))
        self.world.run_until(lambda: self.status(1) == Status.RUNNING)

    def status(self, command: int) -> int:
        reports = self.world.edge.reports(1201)
        statuses = reports[-1]["command_report_array"] if reports else []
        return int(statuses[command]["command_status_id"]) if statuses else 0

    @property
    def message(self) -> str:
        return str(self.world.edge.reports(1201)[-1]["command_report_array"][1].get("message"))

    @property
    def place(self) -> tuple[float, float]:
        north = shifted(HOME[0], HOME[1], 0.0, self._walked_m)
        return shifted(*north, 90.0, SUBJECT_M)

    @property
    def from_subject(self) -> tuple[float, float]:
        """North and east [m] of the vehicle from its subject."""
        return offset(*self.place, *self.vehicle.place)

    def see(self, seconds: float, *, status: int = ACTIVE) -> None:
        """Let the camera send what it tracks, five times a second."""
        for _ in range(round(seconds * 5)):
            self._walked_m += 0.2 * self.speed_m_s
            self._send_status(status)
            self.world.run(0.2)

    def see_until(self, condition: Callable[[], bool], within_s: float = 90.0) -> None:
        end = self.world.clock.now + within_s
        while not condition():
            assert self.world.clock.now < end
            self.see(0.2)

    def _send_status(self, status: int) -> None:
        address = next(iter(self.world.air.vehicles))
        known = self.sends_position and status == ACTIVE
        place = tuple(round(value * 1e7) for value in self.place) if known else (NOWHERE, NOWHERE)
        nothing = math.nan
        geo = mavlink.MAVLink_camera_tracking_geo_status_message(
            status,
            *place,
            HOME[2],
            1.0,
            nothing,
            self.speed_m_s,
            0.0,
            0.0,
            nothing,
            20.0,
            nothing,
            nothing,
        )
        image = mavlink.MAVLink_camera_tracking_image_status_message(
            status, 2, 1, *(nothing, nothing, nothing), 0.2, 0.2, 0.4, 0.4
        )
        for message in (geo, image):
            self.world.air.to_broker(address, self._camera.encode(message))


def track(mode: TrackMode) -> dict[str, Any]:
    parameters = {"corners": [[0.25, 0.25], [0.75, 0.75]], "track_mode": int(mode)}
    return {"command_id": 2, "command_type_id": 9, "parameters": parameters}


def orders_of(vehicle: ScriptedVehicle, command: int) -> list[tuple[float, ...]]:
    return [values for number, values in vehicle.parameters if number == command]


class TestTraceAndProfile:
    @pytest.mark.first_case
    @pytest.mark.parametrize(
        ("mode", "angle"), [(TrackMode.TRACE, 180.0), (TrackMode.PROFILE, 90.0)]
    )
    def test_follow_the_subject_from_behind_or_beside(self, mode: TrackMode, angle: float) -> None:
        scene = Scene(mode)
        scene.see(10.0)
        assert scene.vehicle.custom_mode == PX4_FOLLOW
        assert scene.vehicle.settings["FLW_TGT_FA"] == angle
        assert scene.vehicle.targets >= 40
        latitude, longitude = scene.vehicle.last_target
        assert (latitude, longitude) == pytest.approx(scene.place, abs=1e-5)

    @pytest.mark.thorough
    def test_end_after_a_minute_and_hold(self) -> None:
        scene = Scene(TrackMode.TRACE)
        scene.see_until(lambda: scene.status(1) == Status.FINISHED)
        assert orders_of(scene.vehicle, mavlink.MAV_CMD_CAMERA_STOP_TRACKING)
        scene.world.run_until_over(1201)
        assert scene.world.edge.statuses(1201) == [Status.FINISHED] * 3
        assert scene.message == "None"
        scene.world.run(5.0)
        assert scene.vehicle.settings == dict(PX4.settings)

    def test_of_ardupilot_go_by_its_follow_mode(self) -> None:
        scene = Scene(TrackMode.TRACE, ARDUPILOT)
        scene.see(10.0)
        assert scene.vehicle.custom_mode == COPTER_FOLLOW
        assert scene.vehicle.settings["FOLL_SYSID"] == 254.0


class TestASubjectThatIsLost:
    @pytest.mark.thorough
    def test_ends_the_command_and_the_vehicle_holds(self) -> None:
        scene = Scene(TrackMode.TRACE)
        scene.see(10.0)
        scene.see(5.0, status=IDLE)
        scene.world.run_until(lambda: scene.status(1) == Status.FINISHED, within_s=20.0)
        assert scene.message.startswith("the subject was lost after ")
        scene.world.run_until_over(1201)
        assert scene.world.edge.statuses(1201) == [Status.FINISHED] * 3

    def test_for_a_moment_changes_nothing(self) -> None:
        scene = Scene(TrackMode.TRACE)
        scene.see(10.0)
        scene.see(2.0, status=IDLE)
        scene.see(5.0)
        assert scene.vehicle.custom_mode == PX4_FOLLOW
        assert scene.status(1) == Status.RUNNING


class TestSpotlight:
    @pytest.mark.thorough
    def test_turns_the_nose_to_the_subject_from_where_it_is(self) -> None:
        scene = Scene(TrackMode.SPOTLIGHT)
        place = scene.vehicle.place
        scene.see(6.0)
        assert math.degrees(scene.vehicle.yaw_rad) == pytest.approx(90.0, abs=20.0)
        scene.see(20.0)
        assert math.degrees(scene.vehicle.yaw_rad) == pytest.approx(45.0, abs=10.0)
        assert scene.vehicle.place == pytest.approx(place, abs=1e-6)
        assert scene.vehicle.custom_mode == PX4_HOLD

    def test_of_ardupilot_turns_by_its_own_command(self) -> None:
        scene = Scene(TrackMode.SPOTLIGHT, ARDUPILOT)
        scene.see(6.0)
        assert orders_of(scene.vehicle, mavlink.MAV_CMD_CONDITION_YAW)

    @pytest.mark.thorough
    def test_pro_moves_the_gimbal_only(self) -> None:
        scene = Scene(TrackMode.SPOTLIGHT_PRO)
        before = len(orders_of(scene.vehicle, mavlink.MAV_CMD_DO_REPOSITION))
        scene.see(20.0)
        assert len(orders_of(scene.vehicle, mavlink.MAV_CMD_DO_REPOSITION)) == before
        assert scene.vehicle.targets == 0


class TestAQuickShot:
    @pytest.mark.thorough
    def test_goes_round_a_subject_that_rests_by_the_vehicles_own_circle(self) -> None:
        scene = Scene(TrackMode.QUICK_SHOT)
        scene.speed_m_s = 0.0
        scene.see(4.0)
        assert scene.vehicle.custom_mode == PX4_ORBIT
        (orbit,) = orders_of(scene.vehicle, mavlink.MAV_CMD_DO_ORBIT)
        assert orbit[0] == pytest.approx(SUBJECT_M, abs=2.0)
        scene.see_until(lambda: scene.status(1) == Status.FINISHED)
        scene.world.run_until_over(1201)
        assert scene.world.edge.statuses(1201) == [Status.FINISHED] * 3

    @pytest.mark.first_case
    @pytest.mark.parametrize("speed_m_s", [1.0, 2.5])
    def test_goes_round_a_subject_that_moves_and_along_with_it(self, speed_m_s: float) -> None:
        scene = Scene(TrackMode.QUICK_SHOT)
        scene.speed_m_s = speed_m_s
        offsets: list[tuple[float, float]] = []
        scene.see(6.0)

        def is_over() -> bool:
            offsets.append(scene.from_subject)
            return scene.status(1) == Status.FINISHED

        scene.see_until(is_over)
        distances = [math.hypot(*offset) for offset in offsets]
        assert 0.7 * SUBJECT_M < min(distances) <= max(distances) < 1.4 * SUBJECT_M
        assert {(north > 0.0, east > 0.0) for north, east in offsets} == set(
            itertools.product((False, True), repeat=2)
        )
        assert scene.message == "None"

    @pytest.mark.first_case
    @pytest.mark.parametrize("speed_m_s", [0.0, 1.0, 3.0, 6.0])
    def test_is_never_ordered_to_be_faster_than_the_mission(self, speed_m_s: float) -> None:
        """4 m/s here; the subject's own speed comes on top of that round it."""
        scene = Scene(TrackMode.QUICK_SHOT)
        scene.speed_m_s = speed_m_s
        scene.see(20.0)
        circles = [v[1] for v in orders_of(scene.vehicle, mavlink.MAV_CMD_DO_ORBIT)]
        leads = [v[0] for v in orders_of(scene.vehicle, mavlink.MAV_CMD_DO_REPOSITION)]
        assert circles or leads
        assert max([*circles, *leads]) <= 4.0

    def test_follows_a_subject_that_begins_to_move(self) -> None:
        scene = Scene(TrackMode.QUICK_SHOT)
        scene.speed_m_s = 0.0
        scene.see(5.0)
        assert scene.vehicle.custom_mode == PX4_ORBIT
        scene.speed_m_s = 2.0
        scene.see(6.0)
        assert scene.vehicle.custom_mode == PX4_HOLD
        assert math.hypot(*scene.from_subject) < 1.4 * SUBJECT_M

    def test_flies_backwards_and_up_where_no_circle_will_do(self) -> None:
        denied = {mavlink.MAV_CMD_DO_ORBIT: mavlink.MAV_RESULT_UNSUPPORTED}
        scene = Scene(TrackMode.QUICK_SHOT, dataclasses.replace(PX4, results=denied))
        before = scene.vehicle.height_m
        scene.see_until(lambda: scene.status(1) == Status.FINISHED)
        assert scene.vehicle.height_m == pytest.approx(before + 10.0)
        assert "backwards and up instead of a circle" in scene.message

    def test_flies_backwards_and_up_once_however_often_the_broker_is_killed(
        self, tmp_path: Path
    ) -> None:
        """Each retreat began where the one before had ended, 10 m above it."""
        denied = {mavlink.MAV_CMD_DO_ORBIT: mavlink.MAV_RESULT_UNSUPPORTED}
        script = dataclasses.replace(PX4, results=denied)
        scene = Scene(TrackMode.QUICK_SHOT, script, journal=tmp_path)
        scene.sends_position = False
        begin, height_m = scene.vehicle.place, scene.vehicle.height_m
        for _ in range(3):
            scene.see(10.0)
            scene.world.kill_broker()
            scene.world.run(1.0)
            scene.world.restart_broker()
        scene.see_until(lambda: scene.status(1) == Status.FINISHED)
        assert scene.vehicle.height_m == pytest.approx(height_m + 10.0)
        assert math.hypot(*offset(*begin, *scene.vehicle.place)) == pytest.approx(15.0, abs=0.5)


class TestACommandThatIsCutShort:
    """The camera is ordered to stop, once; else the next pictures would show its subject."""

    @pytest.mark.parametrize("script", [PX4, ARDUPILOT])
    def test_by_an_abort(self, script: Script) -> None:
        scene = Scene(TrackMode.TRACE, script)
        scene.see(5.0)
        scene.world.edge.event(EventType.ABORT_MISSION)
        scene.see(10.0)
        assert stops_of(scene.vehicle) == 1

    def test_by_a_pause(self) -> None:
        scene = Scene(TrackMode.TRACE)
        scene.see(5.0)
        scene.world.edge.event(EventType.PAUSE_MISSION)
        scene.see(5.0)
        assert stops_of(scene.vehicle) == 1
        scene.world.edge.event(EventType.RESUME_MISSION)
        scene.see(5.0)
        assert stops_of(scene.vehicle) == 1
        assert len(orders_of(scene.vehicle, mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE)) == 2

    def test_by_the_pilot_when_the_vehicle_has_landed(self) -> None:
        scene = Scene(TrackMode.TRACE)
        scene.see(5.0)
        scene.vehicle.set_mode(PX4_POSITION)
        scene.see(10.0)
        assert stops_of(scene.vehicle) == 0
        scene.vehicle.set_mode(PX4_LAND)
        scene.see(15.0)
        assert stops_of(scene.vehicle) == 1

    def test_by_an_abort_that_a_restarted_broker_carries_out(self, tmp_path: Path) -> None:
        scene = Scene(TrackMode.TRACE, journal=tmp_path)
        scene.see(5.0)
        scene.world.kill_broker()
        scene.world.edge.event(EventType.ABORT_MISSION)
        scene.world.restart_broker()
        scene.see(20.0)
        assert stops_of(scene.vehicle) == 1

    def test_by_nothing_where_a_restarted_broker_goes_on(self, tmp_path: Path) -> None:
        scene = Scene(TrackMode.TRACE, journal=tmp_path)
        scene.see(5.0)
        scene.world.kill_broker()
        scene.world.restart_broker()
        scene.see(20.0)
        assert stops_of(scene.vehicle) == 0
        scene.see_until(lambda: scene.status(1) == Status.FINISHED)
        scene.see(20.0)
        assert stops_of(scene.vehicle) == 1

    def test_is_ordered_again_by_a_camera_that_is_busy_at_first(self) -> None:
        busy = {mavlink.MAV_CMD_CAMERA_STOP_TRACKING: mavlink.MAV_RESULT_TEMPORARILY_REJECTED}
        scene = Scene(TrackMode.TRACE, dataclasses.replace(PX4, results=busy))
        scene.see(5.0)
        scene.world.edge.event(EventType.ABORT_MISSION)
        scene.see(3.0)
        scene.vehicle.script = PX4
        before = stops_of(scene.vehicle)
        assert before >= 1
        scene.see(15.0)
        assert stops_of(scene.vehicle) == before + 1

    def test_is_ordered_again_some_times_if_nobody_answers(
        self, caplog: pytest.LogCaptureFixture
    ) -> None:
        scene = Scene(TrackMode.TRACE)
        scene.vehicle.lost_answers = {mavlink.MAV_CMD_CAMERA_STOP_TRACKING}
        scene.see(5.0)
        scene.world.edge.event(EventType.ABORT_MISSION)
        scene.see(300.0)
        stops = stops_of(scene.vehicle)
        assert stops > 5
        assert "its camera may still track a subject" in caplog.text
        scene.see(60.0)
        assert stops_of(scene.vehicle) == stops


def stops_of(vehicle: ScriptedVehicle) -> int:
    return len(orders_of(vehicle, mavlink.MAV_CMD_CAMERA_STOP_TRACKING))


@pytest.mark.thorough
def test_a_camera_without_target_position_tracks_by_its_gimbal_alone() -> None:
    scene = Scene(TrackMode.TRACE)
    scene.sends_position = False
    scene.see_until(lambda: scene.status(1) == Status.FINISHED)
    expected = "track_mode TRACE: the camera does not report where the subject is"
    assert scene.message.startswith(expected)
    assert scene.vehicle.targets == 0


def test_the_tracking_status_is_requested_of_the_camera() -> None:
    scene = Scene(TrackMode.TRACE)
    scene.world.run(1.0)
    asked = [int(v[0]) for v in orders_of(scene.vehicle, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)]
    assert {275, 276} <= set(asked)
