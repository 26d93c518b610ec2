"""Plans that come, go or stop fitting while a mission is flown, and over a restart."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from tests.support.autopilot_tester import AutopilotTester
from uav_firmware.msg.status import NavigationState

pytestmark = pytest.mark.scenario

HEIGHT_M = 8.0
FIRST = ((30.0, 0.0), (30.0, 60.0))
SECOND = ((0.0, 25.0), (-20.0, 25.0))


def vehicle(folder: Path) -> AutopilotTester:
    tester = AutopilotTester(SimulationConfig(gps="rtk"), folder)
    tester.wait_until_ready()
    return tester


def route(tester: AutopilotTester, corners: Sequence[tuple[float, float]]) -> list[Any]:
    """Take-off and waypoints."""
    item = tester.ground_station.mission_item
    takeoff = item(0, common.MAV_CMD_NAV_TAKEOFF, tester.place(0.0, 0.0, HEIGHT_M), 0.0)
    return [
        takeoff,
        *(
            item(seq, common.MAV_CMD_NAV_WAYPOINT, tester.place(*corner, HEIGHT_M), 0.0, 1.0, 0.0)
            for seq, corner in enumerate(corners, start=1)
        ),
    ]


def on_its_way(folder: Path) -> AutopilotTester:
    """A vehicle between the first two corners of its mission."""
    tester = vehicle(folder)
    tester.upload(route(tester, FIRST))
    tester.start_mission()
    tester.wait_until(lambda: tester.true_position()[0] > 15.0, 60.0, "under way")
    return tester


def is_near(tester: AutopilotTester, corner: tuple[float, float], within_m: float = 1.5) -> bool:
    return math.dist(tester.true_position()[:2], corner) < within_m


def current(tester: AutopilotTester) -> tuple[int, int]:
    progress = tester.autopilot.topics.mission_progress.value
    assert progress is not None
    return progress.seq_current, progress.seq_total


@pytest.mark.promise
def test_a_new_mission_is_flown_at_once_from_its_first_item(tmp_path: Path) -> None:
    tester = on_its_way(tmp_path)
    height_m = tester.true_position()[2]
    tester.ground_station.items_reached.clear()
    tester.upload(route(tester, SECOND))
    lowest_m = [height_m]
    tester.watch(lambda: lowest_m.append(tester.true_position()[2]))
    tester.wait_until(lambda: is_near(tester, SECOND[-1]), 90.0, "at the new mission's end")
    assert tester.is_in(NavigationState.AUTO_MISSION)
    assert min(lowest_m) > HEIGHT_M - 1.5
    tester.wait_until(
        lambda: set(tester.ground_station.items_reached) == {0, 1, 2}, 10.0, "every item reported"
    )


def test_a_refused_mission_leaves_the_flight_as_it_is(tmp_path: Path) -> None:
    tester = on_its_way(tmp_path)
    bad = route(tester, SECOND)
    bad[1].param3 = 5.0
    tester.ground_station.upload(bad)
    tester.wait_until(lambda: tester.ground_station.mission_ack is not None, 5.0, "answered")
    assert tester.ground_station.mission_ack == common.MAV_MISSION_INVALID_PARAM3
    tester.wait_until(lambda: is_near(tester, FIRST[-1]), 90.0, "at the first mission's end")


def test_clearing_the_mission_in_flight_stops_and_holds(tmp_path: Path) -> None:
    tester = on_its_way(tmp_path)
    tester.ground_station.send(common.MAVLink_mission_clear_all_message(1, 1, 0))
    tester.run_for(6.0)
    place = tester.true_position()
    tester.run_for(10.0)
    assert not tester.landed
    assert tester.status.armed
    assert math.dist(tester.true_position(), place) < 1.0
    assert place[0] < 30.0 + 5.0
    assert abs(place[2] - HEIGHT_M) < 1.0
    assert current(tester) == (0, 0)


def test_a_fence_that_excludes_the_stored_mission_is_reported_and_stops_its_start(
    tmp_path: Path,
) -> None:
    tester = vehicle(tmp_path)
    tester.upload(route(tester, FIRST))
    fence = tester.ground_station.mission_item(
        0, common.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, tester.place(0.0, 0.0, 0.0), 40.0, 0.0, 0.0
    )
    fence.mission_type = common.MAV_MISSION_TYPE_FENCE
    tester.upload([fence])
    texts = tester.ground_station.texts
    tester.wait_until(lambda: "geofence" in "".join(texts), 5.0, "the fence reported")
    assert "Mission cannot be flown: item 2" in "".join(texts)
    answers = tester.ground_station.acks
    answers.clear()
    tester.ground_station.command(common.MAV_CMD_MISSION_START, 0.0, 0.0)
    tester.wait_until(lambda: bool(answers), 5.0, "answered")
    assert answers[0][1] != common.MAV_RESULT_ACCEPTED


def test_a_mission_outlives_the_vehicle_and_begins_at_its_first_item(tmp_path: Path) -> None:
    tester = on_its_way(tmp_path)
    assert current(tester) == (1, 3)
    again = vehicle(tmp_path)
    assert current(again) == (0, 3)
    again.start_mission()
    again.wait_until(lambda: is_near(again, FIRST[0]), 60.0, "at the first corner")
