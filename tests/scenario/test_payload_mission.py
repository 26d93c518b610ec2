"""A mission with pictures: each is taken, where and how the mission said; the truth judges."""

import itertools
import math
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from tests.support.autopilot_tester import AutopilotTester

pytestmark = pytest.mark.scenario

HEIGHT_M = 8.0
SPACING_M = 4.0


class Album:
    """True place and pitch of the gimbal [deg] at each picture."""

    def __init__(self, tester: AutopilotTester) -> None:
        self.places: list[tuple[float, float, float]] = []
        self.pitches_deg: list[float] = []
        self.recorded = False
        self._tester = tester
        tester.watch(self._look)

    def _look(self) -> None:
        topics = self._tester.autopilot.topics
        camera, gimbal = topics.camera_status.value, topics.gimbal_status.value
        if camera is None or gimbal is None:
            return
        self.recorded = self.recorded or camera.recording_since_us >= 0
        while len(self.places) < camera.image_count:
            self.places.append(self._tester.true_position())
            self.pitches_deg.append(math.degrees(gimbal.pitch))


def payload_item(command: int, *parameters: float) -> Any:
    """An item without a place, as QGroundControl writes it; its number comes later."""
    p1, p2, p3, p4, p5, p6, p7 = [*parameters, *[0.0] * (7 - len(parameters))]
    return common.MAVLink_mission_item_int_message(
        1, 1, 0, common.MAV_FRAME_MISSION, command, 0, 1, p1, p2, p3, p4, int(p5), int(p6), p7, 0
    )


def numbered(items: list[Any]) -> list[Any]:
    for seq, item in enumerate(items):
        item.seq = seq
    return items


def mission(tester: AutopilotTester) -> list[Any]:
    """Twelve pictures in a row straight down, then a line of pictures by distance, then home."""
    station, shot = tester.ground_station, common.MAV_CMD_IMAGE_START_CAPTURE

    def waypoint(north_m: float, hold_s: float) -> Any:
        place = tester.place(north_m, 0.0, HEIGHT_M)
        return station.mission_item(0, common.MAV_CMD_NAV_WAYPOINT, place, hold_s, 1.0, 0.0)

    return numbered(
        [
            station.mission_item(
                0, common.MAV_CMD_NAV_TAKEOFF, tester.place(0.0, 0.0, HEIGHT_M), 0.0
            ),
            payload_item(common.MAV_CMD_SET_CAMERA_MODE, 0, 0),
            payload_item(common.MAV_CMD_DO_MOUNT_CONTROL, -90.0, 0, 0, 0, 0, 0, 2),
            payload_item(common.MAV_CMD_VIDEO_START_CAPTURE, 0, 1.0),
            *(payload_item(shot, 0, 0, 1, number) for number in range(1, 13)),
            payload_item(common.MAV_CMD_NAV_DELAY, 6.0),
            payload_item(common.MAV_CMD_VIDEO_STOP_CAPTURE),
            payload_item(common.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, -45.0, 0, math.nan, math.nan),
            payload_item(common.MAV_CMD_DO_SET_CAM_TRIGG_DIST, SPACING_M, 0, 1),
            waypoint(20.0, 0.0),
            payload_item(common.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 0.0),
            payload_item(shot, 0, 1.0, 0),  # for ever, and not stopped by the mission
            waypoint(24.0, 2.0),
            station.return_item(0),
        ]
    )


@pytest.mark.promise
def test_a_mission_takes_every_picture_and_none_on_the_way_home(tmp_path: Path) -> None:
    tester = AutopilotTester(SimulationConfig(gps="rtk", seed=4), tmp_path)
    tester.wait_until_ready()
    tester.upload(mission(tester))
    album = Album(tester)
    tester.start_mission()
    tester.wait_until_landed()
    row, line = album.pitches_deg[:12], album.pitches_deg[12:18]
    assert row == pytest.approx([-90.0] * 12, abs=2.0)
    assert line == pytest.approx([-45.0] * 6, abs=2.0)
    assert all(math.hypot(*place[:2]) < 1.5 for place in album.places[:12])
    norths = [place[0] for place in album.places[12:18]]
    steps = [after - before for before, after in itertools.pairwise(norths)]
    assert steps == pytest.approx([SPACING_M] * 5, abs=0.7)
    assert album.recorded
    assert len(album.places) < 40
    assert all(place[0] > 18.0 for place in album.places[18:])
    camera = tester.autopilot.topics.camera_status.value
    assert camera is not None
    assert camera.image_interval_s == 0.0


def test_a_panorama_in_the_air_turns_the_camera_and_not_the_vehicle(tmp_path: Path) -> None:
    tester = AutopilotTester(SimulationConfig(gps="rtk", seed=5), tmp_path)
    tester.wait_until_ready()
    tester.take_off(HEIGHT_M)
    tester.wait_until(lambda: tester.true_position()[2] > HEIGHT_M - 0.5, 30.0, "at its height")
    tester.run_for(5.0)
    album, heading = Album(tester), tester.estimate.heading
    station = tester.ground_station
    station.command(2800, 180.0)
    tester.wait_until(
        lambda: (2800, common.MAV_RESULT_ACCEPTED) in station.acks, 60.0, "a finished panorama"
    )
    assert (2800, common.MAV_RESULT_IN_PROGRESS) in station.acks
    assert len(album.places) == 5
    assert tester.estimate.heading == pytest.approx(heading, abs=0.1)
    tester.land()
    tester.wait_until(lambda: not tester.status.armed, 60.0, "disarmed")


def test_a_panorama_holds_in_wind_and_ends_when_a_flight_begins(tmp_path: Path) -> None:
    tester = AutopilotTester(SimulationConfig(gps="rtk", seed=5, wind_speed_m_s=7.0), tmp_path)
    tester.wait_until_ready()
    tester.take_off(HEIGHT_M)
    tester.wait_until(lambda: tester.true_position()[2] > HEIGHT_M - 0.5, 30.0, "at its height")
    tester.run_for(5.0)
    station, panorama = tester.ground_station, common.MAV_CMD_PANORAMA_CREATE
    station.command(panorama, 180.0)
    tester.wait_until(
        lambda: (panorama, common.MAV_RESULT_ACCEPTED) in station.acks, 60.0, "a panorama"
    )
    station.command(panorama, 360.0)
    tester.run_for(3.0)
    place = tester.place(40.0, 0.0, HEIGHT_M)
    station.command(common.MAV_CMD_DO_REPOSITION, -1.0, 1.0, 0.0, math.nan, *place[:2], math.nan)
    tester.wait_until(
        lambda: (panorama, common.MAV_RESULT_FAILED) in station.acks, 2.0, "the end of it"
    )
    tester.run_for(0.1)
    assert tester.has_status_text("Panorama ended: the vehicle moves")
    station.command(panorama, 360.0)
    tester.wait_until(
        lambda: (panorama, common.MAV_RESULT_TEMPORARILY_REJECTED) in station.acks, 2.0, "refusal"
    )
