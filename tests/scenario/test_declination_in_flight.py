"""The declination set in a hover turns nobody round; the next landing takes it in."""

import math
from pathlib import Path

import pytest

from sim.config import SimulationConfig
from tests.support.autopilot_tester import AutopilotTester

pytestmark = pytest.mark.scenario


def heading_error_deg(tester: AutopilotTester) -> float:
    error = math.degrees(tester.estimate.heading) - tester.truth.yaw_deg
    return abs((error + 180.0) % 360.0 - 180.0)


@pytest.mark.parametrize("declination_deg", [90.0, -170.0])
def test_it_is_kept_until_the_vehicle_stands(tmp_path: Path, declination_deg: float) -> None:
    tester = AutopilotTester(SimulationConfig(seed=1), tmp_path)
    tester.wait_until_ready()
    tester.take_off(10.0)
    tester.run_for(12.0)
    errors: list[float] = []
    tilts: list[float] = []
    tester.watch(lambda: errors.append(heading_error_deg(tester)))
    tester.watch(lambda: tilts.append(max(abs(tester.truth.roll_deg), abs(tester.truth.pitch_deg))))
    tester.autopilot.registry.set("EKF2_DECL_TYPE", 0)
    tester.autopilot.registry.set("EKF2_MAG_DECL", declination_deg)
    tester.run_for(20.0)
    assert max(errors) < 10.0
    assert max(tilts) < 10.0
    tester.land()
    tester.wait_until_landed()
    tester.run_for(3.0)
    assert heading_error_deg(tester) == pytest.approx(abs(declination_deg), abs=10.0)
