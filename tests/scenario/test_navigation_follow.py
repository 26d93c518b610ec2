"""Follow me and the geofence over MAVLink on the simulated airframe, judged by truth."""

import math
import random
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from tests.support.autopilot_tester import AutopilotTester, hovering_tester
from uav_firmware.msg.status import Command, NavigationState

pytestmark = pytest.mark.scenario

NAN = math.nan
STATION = 255  # System id of the tests' ground station
POSITION, VELOCITY = 1, 2


def report(
    tester: AutopilotTester, north: float, east: float, capabilities: int = POSITION
) -> None:
    latitude, longitude, _ = tester.place(north, east, 0.0)
    tester.ground_station.send(
        common.MAVLink_follow_target_message(
            0,
            capabilities,
            round(latitude * 1e7),
            round(longitude * 1e7),
            tester.start.altitude_amsl_m,
            [3.0, 0.0, 0.0],
            [0.0] * 3,
            [1.0, 0.0, 0.0, 0.0],
            [0.0] * 3,
            [1.0, 0.0, 0.0],
            0,
        )
    )
    tester.run_for(1.0)


def follow(tester: AutopilotTester) -> None:
    tester.ground_station.command(Command.DO_FOLLOW, float(STATION), NAN, NAN, 2.0, 10.0)
    tester.wait_until(
        lambda: tester.mode is NavigationState.AUTO_FOLLOW_TARGET, 2.0, "in follow mode"
    )


@pytest.mark.parametrize("angle", [180.0, 45.0])
def test_a_noisy_target_at_1_hz_is_followed_at_its_distance_and_height(
    tmp_path: Path, angle: float
) -> None:
    tester = hovering_tester(tmp_path, 1, 10.0)
    tester.autopilot.registry.set("FLW_TGT_FA", angle)
    follow(tester)
    noise = random.Random(5)
    distances: list[float] = []
    heights: list[float] = []
    for k in range(70):
        target = (1.5 * k, 5.0)
        report(tester, target[0] + noise.gauss(0.0, 1.0), target[1] + noise.gauss(0.0, 1.0))
        if k >= 25:
            north, east, up = tester.true_position()
            distances.append(math.dist((north, east), (target[0] + 1.5, target[1])))
            heights.append(up)
    assert sum(distances) / len(distances) == pytest.approx(8.0, abs=1.5)
    assert max(abs(distance - 8.0) for distance in distances) < 4.0
    assert max(abs(height - 10.0) for height in heights) < 1.5


@pytest.mark.promise
def test_a_target_without_a_position_moves_the_vehicle_less_than_4_m(tmp_path: Path) -> None:
    tester = hovering_tester(tmp_path, 2, 10.0)
    before = tester.true_position()
    follow(tester)
    for _ in range(15):
        report(tester, 0.0, 0.0, VELOCITY)
        assert math.dist(tester.true_position(), before) < 4.0
