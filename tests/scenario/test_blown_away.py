"""A wind that is stronger than the vehicle: it comes down where it is, and gently."""

from pathlib import Path

import pytest

from sim.config import SimulationConfig
from tests.support.autopilot_tester import AutopilotTester
from uav_firmware.msg.status import NavigationState

pytestmark = pytest.mark.scenario

GENTLE_M_S = 1.0
NEAR_M = 0.3
"""Of the centre of mass, 0.15 m over the feet."""


class Storm:
    """A vehicle over home in a wind that carries it away, and how it touches down."""

    def __init__(self, folder: Path, height_m: float, wind_m_s: float, action: int) -> None:
        config = SimulationConfig(seed=3, wind_speed_m_s=wind_m_s)
        self.tester = AutopilotTester(config, folder)
        self.tester.autopilot.registry.set("COM_WIND_MAX_ACT", action)
        self.tester.wait_until_ready()
        self.tester.take_off(height_m)
        self.sink_m_s = [0.0]
        self.heights_m = [0.0]
        self.tester.watch(self._observe)

    def _observe(self) -> None:
        truth = self.tester.truth
        self.heights_m.append(truth.height_above_home_m)
        if truth.height_above_home_m < NEAR_M and not self.tester.is_in(
            NavigationState.AUTO_TAKEOFF
        ):
            self.sink_m_s.append(truth.velocity_ned[2])

    def run_until_away(self, distance_m: float) -> None:
        self.tester.wait_until(
            lambda: self.tester.true_position()[1] > distance_m, 120.0, "blown away"
        )

    def has_said_once(self, text: str) -> bool:
        return sum(text in line for line in self.tester.lines) == 1


def test_a_landing_descends_in_a_wind_that_carries_the_vehicle_away(tmp_path: Path) -> None:
    storm = Storm(tmp_path, 20.0, 14.0, action=0)
    storm.run_until_away(25.0)
    storm.tester.land()
    east_m = storm.tester.true_position()[1]
    storm.tester.wait_until_landed(45.0)
    assert abs(storm.tester.true_position()[1] - east_m) < 25.0
    assert 0.0 < max(storm.sink_m_s) < GENTLE_M_S
    assert storm.has_said_once("Cannot reach the landing place: landing here")


def test_a_return_against_too_much_wind_stays_low_and_lands_where_it_is(tmp_path: Path) -> None:
    storm = Storm(tmp_path, 10.0, 15.0, action=3)
    storm.tester.wait_until(lambda: storm.tester.is_in(NavigationState.AUTO_RTL), 40.0, "returns")
    storm.tester.wait_until_landed(90.0)
    assert max(storm.heights_m) < 12.0
    assert 0.0 < max(storm.sink_m_s) < GENTLE_M_S
    assert storm.has_said_once("No way home against the wind: landing here")
