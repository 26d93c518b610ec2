"""Orbits on the simulated airframe, judged by the simulator's truth."""

import itertools
import math
from pathlib import Path

import pytest

from tests.support.autopilot_tester import AutopilotTester, hovering_tester
from uav_firmware.lib.rotation import wrap_pi
from uav_firmware.msg.guidance import OrbitHeading
from uav_firmware.msg.status import Command, NavigationState

pytestmark = pytest.mark.scenario

RADIUS_M = 10.0
SPEED_M_S = math.radians(20.0) * RADIUS_M
CENTRE = (12.0, 8.0)


def order(tester: AutopilotTester, radius: float, heading: OrbitHeading, angle: float) -> None:
    latitude, longitude, _ = tester.place(*CENTRE, 0.0)
    home = tester.autopilot.topics.home_position.value
    assert home is not None
    tester.ground_station.command(
        Command.DO_ORBIT,
        radius,
        SPEED_M_S,
        float(heading),
        angle,
        latitude,
        longitude,
        home.altitude_amsl_m + 6.0,
    )
    tester.wait_until(lambda: tester.mode is NavigationState.ORBIT, 2.0, "in orbit mode")


@pytest.mark.parametrize(
    ("seed", "radius", "heading", "turns"),
    [
        (1, RADIUS_M, OrbitHeading.FORWARDS, 2.0),
        (2, -RADIUS_M, OrbitHeading.TOWARDS_CENTRE, 1.0),
        (3, RADIUS_M, OrbitHeading.BACKWARDS, 1.0),
        (4, -RADIUS_M, OrbitHeading.AWAY, 1.0),
        (5, RADIUS_M, OrbitHeading.INITIAL, 1.5),
    ],
)
def test_radius_heading_and_turns_are_those_ordered(
    tmp_path: Path, seed: int, radius: float, heading: OrbitHeading, turns: float
) -> None:
    tester = hovering_tester(tmp_path, seed, 6.0)
    initial = math.radians(tester.truth.yaw_deg)
    order(tester, radius, heading, turns * math.tau)
    status = tester.autopilot.topics.orbit_status
    tester.wait_until(lambda: status.value is not None and status.value.turned > 0.0, 30.0, "there")
    bearings: list[float] = []
    errors: list[float] = []
    turned_away: list[float] = []

    def note() -> None:
        north, east, _ = tester.true_position()
        bearing = math.atan2(east - CENTRE[1], north - CENTRE[0])
        bearings.append(bearing)
        errors.append(math.dist((north, east), CENTRE) - RADIUS_M)
        ahead = bearing + math.copysign(0.5 * math.pi, radius)
        wanted = {
            OrbitHeading.FORWARDS: ahead,
            OrbitHeading.BACKWARDS: ahead + math.pi,
            OrbitHeading.TOWARDS_CENTRE: bearing + math.pi,
            OrbitHeading.AWAY: bearing,
        }.get(heading, initial)
        turned_away.append(abs(wrap_pi(math.radians(tester.truth.yaw_deg) - wanted)))

    tester.watch(note)
    tester.wait_until(lambda: tester.mode is NavigationState.AUTO_LOITER, 90.0, "round")
    tester.run_for(1.5)
    turned = sum(wrap_pi(b - a) for a, b in itertools.pairwise(bearings))
    assert turned == pytest.approx(math.copysign(turns * math.tau, radius), abs=math.radians(3.0))
    assert math.sqrt(sum(e * e for e in errors) / len(errors)) <= 0.30
    assert max(turned_away) < math.radians(10.0)
