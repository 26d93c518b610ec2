"""What can be set in flight leaves the vehicle in control; what cannot is refused."""

import math
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from tests.support.autopilot_tester import AutopilotTester
from uav_firmware.lib.rotation import tilt_of
from uav_firmware.parameters import ParameterLockedError, ParameterRangeError

pytestmark = pytest.mark.scenario

GAINS = (
    "MC_ROLLRATE_K",
    "MC_PITCHRATE_K",
    "MC_YAWRATE_K",
    "MC_ROLLRATE_P",
    "MC_PITCHRATE_P",
    "MC_YAWRATE_P",
    "MC_ROLLRATE_D",
    "MC_PITCHRATE_D",
    "MC_ROLL_P",
    "MC_PITCH_P",
    "MPC_XY_P",
    "MPC_Z_P",
    "MPC_THR_MIN",
)
LOCKED = (
    "CA_ROTOR0_PX",
    "CA_ROTOR3_KM",
    "THR_MDL_FAC",
    "RL_ACC",
    "FD_ACT_RPM_FULL",
    "EKF2_HEAD_NOISE",
)


def hovering(folder: Path) -> AutopilotTester:
    tester = AutopilotTester(SimulationConfig(seed=1, wind_speed_m_s=4.0), folder)
    tester.wait_until_ready()
    tester.take_off(10.0)
    tester.run_for(12.0)
    return tester


@pytest.mark.parametrize("bound", ["minimum", "maximum"])
def test_every_gain_may_go_to_its_bound(tmp_path: Path, bound: str) -> None:
    """One after the other, each through an order to fly 6 m aside."""
    tester = hovering(tmp_path)
    registry = tester.autopilot.registry
    tilts: list[float] = []
    heights: list[float] = []
    tester.watch(lambda: tilts.append(math.degrees(tilt_of(tester.truth.q_ned_frd))))
    tester.watch(lambda: heights.append(tester.truth.height_above_home_m))
    for index, name in enumerate(GAINS):
        declaration = registry.declaration(name)
        registry.set(name, getattr(declaration, bound))
        side = 6.0 if index % 2 == 0 else 0.0
        latitude, longitude, _ = tester.place(side, side, 0.0)
        nan = math.nan
        tester.ground_station.command(
            common.MAV_CMD_DO_REPOSITION, -1.0, 1.0, 0.0, nan, latitude, longitude, nan
        )
        tester.run_for(4.0)
        assert max(tilts) < 60.0, name
        assert 7.0 < min(heights) < max(heights) < 13.0, name
        registry.set(name, declaration.default)
    assert tester.status.armed


def test_a_parameter_that_disables_control_is_refused(tmp_path: Path) -> None:
    tester = hovering(tmp_path)
    registry = tester.autopilot.registry
    for name in ("MC_ROLLRATE_P", "MC_PITCHRATE_P", "MC_ROLL_P", "MC_PITCH_P"):
        with pytest.raises(ParameterRangeError):
            registry.set(name, 0.0)
    for name in LOCKED:
        declaration = registry.declaration(name)
        with pytest.raises(ParameterLockedError):
            registry.set(name, declaration.maximum)
    tester.land()
    tester.wait_until_landed()
    for name in LOCKED:
        registry.set(name, registry.declaration(name).maximum)
