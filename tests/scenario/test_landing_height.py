"""A descent ends gently wherever home, or the place that was ordered, puts the ground."""

import math
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from sim.fault_schedule import Fault
from sim.faults.notation import read_order
from tests.support.autopilot_tester import AutopilotTester
from tests.support.stick_pilot import StickPilot, change_mode

pytestmark = pytest.mark.scenario

POSITION = 3
GENTLE_M_S = 1.0
NEAR_M = 0.3
"""Of the centre of mass, 0.15 m over the feet: a sink speed so low is that of the touch-down."""


class Descent:
    """A vehicle that hovers, and the sink speed that it has near the ground from now on."""

    def __init__(self, folder: Path, height_m: float) -> None:
        self.tester = AutopilotTester(SimulationConfig(gps="rtk"), folder)
        self.tester.wait_until_ready()
        self.tester.take_off(height_m)
        self.tester.wait_until(
            lambda: self.tester.truth.height_above_home_m > height_m - 1.0, 60.0, "up"
        )
        self.tester.run_for(3.0)
        self._touch_downs = [0.0]
        self._began_s = self.now_s
        self.tester.watch(self._observe)

    def _observe(self) -> None:
        if self.tester.truth.height_above_home_m < NEAR_M:
            self._touch_downs.append(self.tester.truth.velocity_ned[2])

    @property
    def now_s(self) -> float:
        return self.tester.truth.time_us * 1e-6

    def order(self, command: int, *parameters: float) -> None:
        self.tester.send_command(command, *parameters)

    def place(self, north_m: float, height_m: float) -> tuple[float, float, float]:
        """Latitude, longitude [deg] and AMSL altitude [m] of a place about the start."""
        latitude_deg, longitude_deg, _ = self.tester.place(north_m, 0.0, 0.0)
        return latitude_deg, longitude_deg, self.tester.start.altitude_amsl_m + height_m

    def set_home(self, height_m: float) -> None:
        """Set home so high above the true ground below."""
        place = self.place(0.0, height_m)
        self.order(common.MAV_CMD_DO_SET_HOME, 0.0, 0.0, 0.0, 0.0, *place)
        self.tester.run_for(0.5)

    def break_part(self, line: str) -> None:
        fault = read_order(line, self.tester.truth.time_us)
        assert isinstance(fault, Fault)
        self.tester.simulation.add_fault(fault)

    def end(self, within_s: float) -> float:
        """The greatest sink speed [m/s] at the ground."""
        self.tester.wait_until_landed(within_s)
        return max(self._touch_downs)


@pytest.mark.parametrize("home_m", [-30.0, -8.0, -3.0, 0.0, 3.0])
@pytest.mark.parametrize(
    "command", [common.MAV_CMD_NAV_LAND, common.MAV_CMD_NAV_RETURN_TO_LAUNCH], ids=["land", "rtl"]
)
def test_a_landing_is_gentle_wherever_home_is(tmp_path: Path, command: int, home_m: float) -> None:
    descent = Descent(tmp_path, 12.0)
    descent.set_home(home_m)
    descent.order(command, 0.0, 0.0, 0.0, math.nan, math.nan, math.nan, math.nan)
    assert 0.0 < descent.end(within_s=90.0) < GENTLE_M_S


@pytest.mark.parametrize(
    "fault", ["rangefinder_frozen", "rangefinder_blocked", "rangefinder_blocked distance_m=30"]
)
@pytest.mark.parametrize("height_m", [12.0, 2.5])
def test_a_landing_with_a_stuck_range_finder_is_gentle(
    tmp_path: Path, fault: str, height_m: float
) -> None:
    descent = Descent(tmp_path, 12.0)
    descent.order(common.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, math.nan, math.nan, math.nan, math.nan)
    descent.tester.wait_until(
        lambda: descent.tester.truth.height_above_home_m < height_m, 60.0, "low"
    )
    descent.break_part(fault)
    assert 0.0 < descent.end(within_s=60.0) < GENTLE_M_S
    terrain = descent.tester.autopilot.topics.terrain_estimate.value
    assert terrain is not None
    assert terrain.has_failed


@pytest.mark.parametrize("fault", ["rangefinder_frozen", "rangefinder_blocked"])
def test_a_landing_above_home_stays_slow_where_the_range_finder_gets_stuck(
    tmp_path: Path, fault: str
) -> None:
    descent = Descent(tmp_path, 12.0)
    descent.set_home(-8.0)
    descent.tester.autopilot.registry.set("MPC_Z_V_AUTO_DN", 4.0)
    descent.order(common.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, math.nan, math.nan, math.nan, math.nan)
    descent.tester.wait_until(lambda: descent.tester.truth.height_above_home_m < 2.4, 60.0, "low")
    descent.break_part(fault)
    assert 0.0 < descent.end(within_s=60.0) < GENTLE_M_S


@pytest.mark.parametrize(
    "fault", ["rangefinder_loss", "rangefinder_blocked", "rangefinder_blocked distance_m=30"]
)
@pytest.mark.parametrize(
    "command", [common.MAV_CMD_NAV_LAND, common.MAV_CMD_NAV_RETURN_TO_LAUNCH], ids=["land", "rtl"]
)
def test_a_landing_above_home_is_gentle_where_the_range_finder_has_failed_before(
    tmp_path: Path, fault: str, command: int
) -> None:
    descent = Descent(tmp_path, 15.0)
    descent.set_home(-8.0)
    descent.break_part(fault)
    descent.tester.run_for(2.0)
    descent.order(command, 0.0, 0.0, 0.0, math.nan, math.nan, math.nan, math.nan)
    assert 0.0 < descent.end(within_s=60.0) < GENTLE_M_S


def test_a_landing_at_a_place_that_was_given_too_low_is_gentle(tmp_path: Path) -> None:
    descent = Descent(tmp_path, 12.0)
    place = descent.place(5.0, -50.0)
    descent.order(common.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, math.nan, *place)
    assert 0.0 < descent.end(within_s=90.0) < GENTLE_M_S


def test_a_home_that_was_set_in_the_air_makes_no_landing_slow(tmp_path: Path) -> None:
    descent = Descent(tmp_path, 25.0)
    descent.set_home(25.0)
    began_s = descent.now_s
    descent.order(common.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, math.nan, math.nan, math.nan, math.nan)
    assert 0.0 < descent.end(within_s=90.0) < GENTLE_M_S
    assert descent.now_s - began_s < 35.0


def test_a_place_under_the_ground_is_not_flown_to(tmp_path: Path) -> None:
    descent = Descent(tmp_path, 12.0)
    place = descent.place(0.0, -99.0)
    descent.order(common.MAV_CMD_DO_REPOSITION, -1.0, 1.0, 0.0, math.nan, *place)
    descent.tester.run_for(40.0)
    assert descent.tester.truth.height_above_home_m == pytest.approx(2.0, abs=0.6)
    assert descent.tester.has_status_text("under the ground")


@pytest.mark.parametrize("home_m", [-30.0, 0.0])
@pytest.mark.parametrize("is_steep", [False, True])
def test_a_descent_by_stick_is_gentle(tmp_path: Path, home_m: float, *, is_steep: bool) -> None:
    descent = Descent(tmp_path, 12.0)
    descent.set_home(home_m)
    if is_steep:
        registry = descent.tester.autopilot.registry
        registry.set("MPC_Z_VEL_MAX_DN", 4.0)
        registry.set("MPC_LAND_ALT1", 1.0)
        registry.set("MPC_LAND_ALT2", 1.0)
    pilot = StickPilot(descent.tester)
    descent.tester.run_for(0.2)
    change_mode(descent.tester, POSITION)
    pilot.move(up=-1.0)
    assert 0.0 < descent.end(within_s=60.0) < GENTLE_M_S
