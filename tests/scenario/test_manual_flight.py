"""A pilot flies by sticks; the simulator's truth judges."""

import math
from pathlib import Path
from typing import Any

import pytest

from sim.config import SimulationConfig
from tests.support.autopilot_tester import AutopilotTester
from tests.support.stick_pilot import StickPilot, change_mode
from uav_firmware.lib.rotation import to_euler
from uav_firmware.msg.status import NavigationState

pytestmark = pytest.mark.scenario

ALTITUDE, POSITION, ACRO, STABILIZED = 2, 3, 5, 7


def ready(folder: Path, main_mode: int, **config: Any) -> tuple[AutopilotTester, StickPilot]:
    """A vehicle on the ground in a piloted mode, its pilot at the sticks."""
    tester = AutopilotTester(SimulationConfig(gps="rtk", **config), folder)
    tester.wait_until_ready()
    pilot = StickPilot(tester)
    tester.run_for(0.2)
    change_mode(tester, main_mode)
    return tester, pilot


def climb(tester: AutopilotTester, pilot: StickPilot, height: float) -> None:
    """Arm and lift off by stick."""
    tester.arm()
    pilot.move(up=0.8)
    tester.wait_until(lambda: tester.true_position()[2] > height, 20.0, f"{height} m up")
    pilot.move()
    tester.run_for(4.0)


@pytest.mark.parametrize("main_mode", [POSITION, ALTITUDE])
@pytest.mark.parametrize("wind", [0.0, 5.0])
def test_the_sticks_move_the_vehicle_without_loss_of_height(
    tmp_path: Path, main_mode: int, wind: float
) -> None:
    tester, pilot = ready(tmp_path, main_mode, wind_speed_m_s=wind)
    climb(tester, pilot, 5.0)
    start = tester.true_position()
    heights: list[float] = []
    tester.watch(lambda: heights.append(tester.true_position()[2]))
    pilot.move(forward=0.6)
    tester.run_for(6.0)
    end = tester.true_position()
    assert end[0] - start[0] > 5.0
    assert min(heights) > start[2] - 0.5
    assert max(heights) < start[2] + 0.5


@pytest.mark.parametrize(
    ("sticks", "axis", "sign"),
    [
        ({"forward": 1.0}, 0, 1), ({"forward": -1.0}, 0, -1), ({"right": 1.0}, 1, 1),
        ({"right": -1.0}, 1, -1), ({"up": 1.0}, 2, 1), ({"up": -1.0}, 2, -1),
    ],
)  # fmt: skip
def test_each_stick_has_its_direction(
    tmp_path: Path, sticks: dict[str, float], axis: int, sign: int
) -> None:
    tester, pilot = ready(tmp_path, POSITION)
    climb(tester, pilot, 6.0)
    start = tester.true_position()
    pilot.move(**sticks)
    tester.run_for(2.0)
    moved = [end - begin for end, begin in zip(tester.true_position(), start, strict=True)]
    assert sign * moved[axis] > 1.0
    assert all(abs(other) < 0.6 for i, other in enumerate(moved) if i != axis)


def test_turning_the_nose_turns_forward_with_it(tmp_path: Path) -> None:
    tester, pilot = ready(tmp_path, POSITION)
    climb(tester, pilot, 5.0)
    pilot.move(yaw=0.6)
    tester.wait_until(lambda: yaw_deg(tester) > 70.0, 10.0, "facing east")
    pilot.move()
    tester.run_for(2.0)
    start, nose = tester.true_position(), math.radians(yaw_deg(tester))
    pilot.move(forward=1.0)
    tester.run_for(3.0)
    end = tester.true_position()
    along = (end[0] - start[0]) * math.cos(nose) + (end[1] - start[1]) * math.sin(nose)
    across = (end[1] - start[1]) * math.cos(nose) - (end[0] - start[0]) * math.sin(nose)
    assert along > 5.0
    assert abs(across) < 1.0


def yaw_deg(tester: AutopilotTester) -> float:
    return math.degrees(to_euler(tester.truth.q_ned_frd)[2])


@pytest.mark.promise
def test_centred_sticks_brake_and_hold_the_place(tmp_path: Path) -> None:
    tester, pilot = ready(tmp_path, POSITION, wind_speed_m_s=5.0)
    climb(tester, pilot, 5.0)
    pilot.move(forward=1.0)
    tester.run_for(5.0)
    assert math.hypot(*tester.truth.velocity_ned[:2]) > 6.0
    pilot.move()
    tester.run_for(6.0)
    place = tester.true_position()
    tester.run_for(10.0)
    assert math.dist(place, tester.true_position()) < 1.0


@pytest.mark.parametrize("main_mode", [POSITION, ALTITUDE])
def test_a_landing_by_stick_is_soft_and_ends_disarmed(tmp_path: Path, main_mode: int) -> None:
    tester, pilot = ready(tmp_path, main_mode)
    climb(tester, pilot, 3.0)
    sinks: list[tuple[float, float]] = []
    tester.watch(lambda: sinks.append((tester.true_position()[2], tester.truth.velocity_ned[2])))
    pilot.move(up=-1.0)
    tester.wait_until_landed(30.0)
    assert max(sink for height, sink in sinks if height < 0.5) < 1.0
    assert not tester.simulation.wrecked


def test_the_throttle_centred_hovers_in_stabilized_mode(tmp_path: Path) -> None:
    tester, pilot = ready(tmp_path, STABILIZED)
    pilot.move(up=-1.0)
    tester.run_for(0.2)
    tester.arm()
    tester.run_for(1.5)
    pilot.move(up=0.2)
    tester.wait_until(lambda: tester.true_position()[2] > 4.0, 30.0, "4 m up")
    pilot.move()
    tester.run_for(1.0)
    speed = tester.truth.velocity_ned[2]
    pilot.move(right=0.5)
    tester.run_for(0.7)
    roll, pitch, _ = to_euler(tester.truth.q_ned_frd)
    assert 5.0 < math.degrees(roll) < 25.0
    assert abs(math.degrees(pitch)) < 4.0
    assert abs(tester.truth.velocity_ned[2] - speed) < 1.0


def test_acro_turns_at_the_rate_of_the_stick(tmp_path: Path) -> None:
    tester, pilot = ready(tmp_path, POSITION)
    climb(tester, pilot, 12.0)
    change_mode(tester, ACRO)
    pilot.move(yaw=0.5, up=0.05)
    tester.run_for(1.5)
    assert math.degrees(tester.truth.rate_frd[2]) == pytest.approx(50.0, abs=10.0)
    change_mode(tester, POSITION)
    pilot.move()
    tester.run_for(6.0)
    assert math.hypot(*tester.truth.velocity_ned) < 0.5


def test_a_mode_changes_in_the_air_without_a_jolt(tmp_path: Path) -> None:
    tester, pilot = ready(tmp_path, POSITION)
    climb(tester, pilot, 6.0)
    heights: list[float] = []
    tester.watch(lambda: heights.append(tester.true_position()[2]))
    for main, sub in ((ALTITUDE, 0), (4, 3), (POSITION, 0), (4, 3)):
        change_mode(tester, main, sub)
        tester.run_for(3.0)
    assert max(heights) - min(heights) < 0.5


def test_lost_sticks_bring_the_vehicle_home(tmp_path: Path) -> None:
    tester, pilot = ready(tmp_path, POSITION)
    climb(tester, pilot, 5.0)
    pilot.move(forward=1.0)
    tester.run_for(5.0)
    pilot.sending = False
    tester.wait_until(
        lambda: tester.mode is NavigationState.AUTO_LOITER, 2.0, "holding for the operator"
    )
    tester.wait_until(lambda: tester.mode is NavigationState.AUTO_RTL, 6.0, "returning")
    tester.wait_until_landed()
    north, east, _ = tester.true_position()
    assert math.hypot(north, east) < 1.0


def test_a_pilot_who_moves_a_stick_takes_over_from_hold(tmp_path: Path) -> None:
    tester = AutopilotTester(SimulationConfig(gps="rtk"), tmp_path)
    tester.wait_until_ready()
    pilot = StickPilot(tester)
    tester.take_off(5.0)
    tester.run_for(10.0)
    assert tester.is_in(NavigationState.AUTO_LOITER)
    pilot.move(right=0.5)
    tester.run_for(0.5)
    assert tester.is_in(NavigationState.POSCTL)


def test_a_throttle_that_is_up_keeps_the_vehicle_disarmed(tmp_path: Path) -> None:
    tester, pilot = ready(tmp_path, POSITION)
    pilot.move(up=1.0)
    tester.run_for(0.2)
    with pytest.raises(AssertionError, match="Throttle"):
        tester.arm()


@pytest.mark.parametrize("main_mode", [POSITION, ALTITUDE])
@pytest.mark.parametrize("stick", [0.15, 0.3])
def test_a_slow_take_off_by_stick_misleads_no_sensor(
    tmp_path: Path, main_mode: int, stick: float
) -> None:
    """Rising by a few centimetres per second, the vehicle looks at rest to its inertial sensor.

    Velocity held at zero meanwhile would be taken for a bias of the accelerometer, whose failsafe
    lands; and the time in which a take-off must follow the arming ends at a height of 0.2 m.
    """
    tester, pilot = ready(tmp_path, main_mode)
    tester.arm()
    pilot.move(up=stick)
    biases: list[float] = []
    core = tester.autopilot.estimator.estimator.core
    assert core is not None
    tester.watch(lambda: biases.append(max(map(abs, core.state.accel_bias_frd))))
    tester.wait_until(lambda: tester.true_position()[2] > 0.5, 30.0, "half a metre up")
    tester.run_for(3.0)
    assert max(biases) < 0.1
    assert tester.status.armed
    assert tester.mode in {NavigationState.POSCTL, NavigationState.ALTCTL}
