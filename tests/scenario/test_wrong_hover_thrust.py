"""MPC_THR_HOVER far from the truth, 0.225: a flight keeps its motors and its height, and lands."""

from pathlib import Path

import pytest

from sim.config import SimulationConfig
from tests.support.autopilot_tester import AutopilotTester

pytestmark = pytest.mark.scenario

HEIGHT_M = 10.0


@pytest.mark.parametrize(
    ("hover", "learns"), [(0.1, 1), (0.5, 1), (0.8, 1), (0.5, 0)], ids=str
)  # 0.5 is PX4's default
def test_the_motors_run_from_take_off_to_landing(tmp_path: Path, hover: float, learns: int) -> None:
    tester = AutopilotTester(SimulationConfig(seed=1, wind_speed_m_s=4.0), tmp_path)
    tester.autopilot.registry.set("MPC_THR_HOVER", hover)
    tester.autopilot.registry.set("MPC_USE_HTE", learns)
    tester.wait_until_ready()
    tester.take_off(HEIGHT_M)
    tester.run_for(12.0)
    heights: list[float] = []
    stopped: list[bool] = []
    tester.watch(lambda: heights.append(tester.truth.height_above_home_m))
    tester.watch(lambda: stopped.append(tester.landed or min(tester.truth.rotor_rpm) < 1000.0))
    tester.run_for(15.0)
    assert HEIGHT_M - 0.7 < min(heights) < max(heights) < HEIGHT_M + 0.7
    tester.land()
    tester.wait_until(lambda: tester.truth.height_above_home_m < 0.25, 60.0, "down")
    assert not any(stopped)
    tester.wait_until_landed(5.0)
    assert not tester.simulation.wrecked
