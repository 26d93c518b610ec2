"""A vehicle that has crashed stops its motors within two seconds; one that flies hard does not."""

import math
from collections.abc import Sequence
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from sim.fault_schedule import Fault, Kind
from tests.support.autopilot_tester import AutopilotTester
from tests.support.stick_pilot import StickPilot, change_mode
from uav_firmware.lib.rotation import tilt_of

pytestmark = pytest.mark.scenario

LATEST_DISARM_S = 2.0
FORCE = 21196.0
MOTOR = Kind.MOTOR_LOSS
ALTITUDE, POSITION, ACRO, STABILIZED = 2, 3, 5, 7


def ready(folder: Path, settings: dict[str, float] | None = None, imus: int = 3) -> AutopilotTester:
    tester = AutopilotTester(SimulationConfig(seed=1, imus=imus), folder)
    for name, value in (settings or {}).items():
        tester.autopilot.registry.set(name, value)
    tester.wait_until_ready()
    return tester


def hovering(folder: Path, imus: int = 3) -> AutopilotTester:
    tester = ready(folder, imus=imus)
    tester.take_off(10.0)
    tester.run_for(12.0)
    return tester


def strike(tester: AutopilotTester, kind: Kind, **values: float) -> None:
    now_us = tester.simulation.time_us
    tester.simulation.add_fault(Fault(kind=kind, start_us=now_us, values=values))


def is_stopped(tester: AutopilotTester) -> bool:
    motors = tester.autopilot.topics.actuator_motors.value
    return not tester.status.armed and motors is not None and motors.control == (0.0,) * 4


@pytest.mark.first_case
@pytest.mark.promise
@pytest.mark.parametrize(
    "faults",
    [
        [(MOTOR, {"motor": 1}), (MOTOR, {"motor": 3})],
        [(MOTOR, {"motor": motor}) for motor in (1, 2, 3, 4)],
    ],
    ids=["two_motors", "four_motors"],
)
def test_a_wreck_stops_its_motors_and_is_reported(
    tmp_path: Path, faults: Sequence[tuple[Kind, dict[str, float]]]
) -> None:
    tester = hovering(tmp_path, imus=1)  # With three the loss of one sensor is no crash
    for kind, values in faults:
        strike(tester, kind, **values)
    tester.wait_until(lambda: tester.simulation.wrecked, 20.0, "on the ground")
    tester.wait_until(lambda: is_stopped(tester), LATEST_DISARM_S, "stopped")
    tester.run_for(1.0)
    assert tester.has_status_text("Crash detected, motors stopped")
    assert any("Crash detected" in text for text in tester.ground_station.texts)
    assert not tester.status.sensors_health & common.MAV_SYS_STATUS_SENSOR_PROPULSION
    tester.ground_station.command(common.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    tester.run_for(0.5)
    assert not tester.status.armed


@pytest.mark.parametrize(
    "faults",
    [[(Kind.GYRO_BIAS, {"x_deg_s": 200.0})], [(MOTOR, {"motor": 1}), (MOTOR, {"motor": 3})]],
    ids=["gyroscope", "two_motors"],
)
def test_a_wreck_blames_no_motor_for_what_the_ground_has_done(
    tmp_path: Path, faults: Sequence[tuple[Kind, dict[str, float]]]
) -> None:
    """Rotors stop at the ground: that is the crash, reported at once, and no failure of motors."""
    tester = hovering(tmp_path, imus=1)
    for kind, values in faults:
        strike(tester, kind, **values)
    tester.wait_until(lambda: tester.simulation.wrecked, 20.0, "on the ground")
    tester.wait_until(lambda: is_stopped(tester), 0.1, "stopped")
    tester.run_for(1.0)
    assert tester.has_status_text("Crash: has hit something, rotors stand")
    truly = {f"Motor {values['motor']}" for kind, values in faults if kind is MOTOR}
    named = {f"Motor {n}" for n in (1, 2, 3, 4) if tester.has_status_text(f"Motor {n} failed")}
    assert named == truly


def test_a_wreck_that_lies_upright_stops_its_motors(tmp_path: Path) -> None:
    """It came down in acro at low throttle: the ground carries it, and its rotors stand."""
    tester = hovering(tmp_path)
    pilot = StickPilot(tester)
    tester.run_for(0.2)
    change_mode(tester, ACRO)
    pilot.move(up=-0.5)
    tester.wait_until(lambda: tester.simulation.wrecked, 10.0, "on the ground")
    assert tilt_of(tester.truth.q_ned_frd) < math.radians(15.0)
    tester.wait_until(lambda: is_stopped(tester), LATEST_DISARM_S, "stopped")
    tester.run_for(1.0)
    assert tester.has_status_text("Crash: has hit something, rotors stand")


def test_on_two_motors_of_one_diagonal_it_comes_down_and_stops(tmp_path: Path) -> None:
    tester = hovering(tmp_path)
    strike(tester, MOTOR, motor=1)
    strike(tester, MOTOR, motor=2)
    tester.wait_until(
        lambda: tester.truth.height_above_home_m < 0.25 and abs(tester.truth.rate_frd[2]) < 0.3,
        20.0,
        "at rest on the ground",
    )
    tester.wait_until(lambda: is_stopped(tester), LATEST_DISARM_S, "stopped")


def test_a_vehicle_that_is_disarmed_in_the_air_is_a_wreck(tmp_path: Path) -> None:
    """Nobody arms it again, by whatever program, before somebody has looked at it."""
    tester = hovering(tmp_path)
    tester.ground_station.command(common.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, FORCE)
    tester.wait_until(lambda: tester.simulation.wrecked, 5.0, "on the ground")
    tester.run_for(1.0)
    assert tester.has_status_text("Crash: fell with its motors stopped")
    assert not tester.status.sensors_health & common.MAV_SYS_STATUS_SENSOR_PROPULSION
    tester.ground_station.command(common.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    tester.run_for(0.5)
    assert not tester.status.armed
    assert any("ARM_DISARM refused" in text for text in tester.ground_station.texts)
    failures = tester.autopilot.topics.failure_detector_status.value
    assert failures is not None
    assert failures.crash


def test_a_lost_attitude_disarms_just_after_the_take_off(tmp_path: Path) -> None:
    """COM_LKDOWN_TKO: a vehicle whose motors are plugged in wrongly does not climb on its side."""
    tester = ready(tmp_path)
    tester.take_off(10.0)
    tester.wait_until(lambda: tester.true_position()[2] > 1.5, 10.0, "not yet on the ground again")
    strike(tester, MOTOR, motor=1)
    strike(tester, MOTOR, motor=3)
    tester.wait_until(lambda: not tester.status.armed, 2.0, "disarmed")
    tester.run_for(0.3)  # Lines are written ten times a second
    assert tester.has_status_text("Attitude beyond limits: DISARM")


def test_a_hard_landing_is_no_crash(tmp_path: Path) -> None:
    """Five landings at 2 m/s without slowing down, the hardest that the parameters allow."""
    settings = {"MPC_LAND_SPEED": 2.0, "MPC_Z_VEL_MAX_DN": 4.0, "MPC_Z_V_AUTO_DN": 4.0}
    tester = ready(tmp_path, {**settings, "MPC_LAND_ALT2": 1.0, "MPC_LAND_ALT3": 0.3})
    for _ in range(5):
        tester.take_off(4.0)
        tester.run_for(6.0)
        tester.land()
        tester.wait_until_landed(30.0)
        tester.run_for(3.0)
    assert not tester.has_status_text("Crash")


def test_flips_and_hard_sticks_are_no_crash(tmp_path: Path) -> None:
    """Acro rolls through more than a turn, full stick in stabilized mode, punches of throttle."""
    tester = ready(tmp_path, {"MC_ACRO_R_MAX": 360.0, "MC_ACRO_P_MAX": 360.0})
    pilot = StickPilot(tester)
    tester.run_for(0.2)
    change_mode(tester, POSITION)
    tester.arm()
    pilot.move(up=0.9)
    tester.wait_until(lambda: tester.true_position()[2] > 60.0, 60.0, "60 m up")
    tilts: list[float] = []
    tester.watch(lambda: tilts.append(tilt_of(tester.truth.q_ned_frd)))
    for mode, sticks in (
        (ACRO, {"right": 1.0, "up": 0.3}),
        (ACRO, {"forward": -1.0, "up": 0.3}),
        (STABILIZED, {"right": 1.0, "forward": 1.0, "up": 0.6}),
        (STABILIZED, {"right": -1.0, "up": -1.0}),
        (ALTITUDE, {"forward": 1.0, "up": 1.0}),
    ):
        change_mode(tester, mode)
        pilot.move(**sticks)
        tester.run_for(1.5)
        pilot.move()
        change_mode(tester, POSITION)
        tester.run_for(5.0)
        assert tester.status.armed, tester.lines[-6:]
    assert max(tilts) > math.radians(120.0)  # It has really been upside down
    assert not tester.has_status_text("Crash")
    assert not tester.simulation.wrecked
