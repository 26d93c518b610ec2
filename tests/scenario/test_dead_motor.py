"""A motor that is dead never lifts off: latched after a flight, found by the idling before one."""

from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from sim.fault_schedule import Fault, Kind
from tests.support.autopilot_tester import AutopilotTester

pytestmark = pytest.mark.scenario


def ready(folder: Path, seed: int) -> AutopilotTester:
    tester = AutopilotTester(SimulationConfig(seed=seed), folder)
    tester.wait_until_ready()
    return tester


def kill(tester: AutopilotTester, motor: int) -> None:
    now_us = tester.simulation.time_us
    values = {"motor": float(motor)}
    tester.simulation.add_fault(Fault(kind=Kind.MOTOR_LOSS, start_us=now_us, values=values))


def arming_result(tester: AutopilotTester) -> int:
    station = tester.ground_station
    before = len(station.acks)
    station.command(common.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    tester.wait_until(lambda: len(station.acks) > before, 2.0, "answered")
    return station.acks[-1][1]


def stays_on_ground(tester: AutopilotTester, seconds: float) -> None:
    heights: list[float] = []
    tester.watch(lambda: heights.append(tester.true_position()[2]))
    tester.run_for(seconds)
    assert max(heights) < 0.05
    assert not tester.status.armed


@pytest.mark.parametrize("motor", [1, 2, 3, 4])
def test_a_motor_dead_before_the_arming_is_found_while_the_others_idle(
    tmp_path: Path, motor: int
) -> None:
    tester = ready(tmp_path, seed=motor)
    kill(tester, motor)
    tester.run_for(1.0)
    tester.take_off(10.0)
    stays_on_ground(tester, 5.0)
    assert any(f"Motor {motor} failed" in line for line in tester.lines)
    assert any("Disarmed: motor failure" in line for line in tester.lines)
    assert arming_result(tester) == common.MAV_RESULT_TEMPORARILY_REJECTED


def test_a_motor_lost_in_flight_is_acknowledged_before_the_next_one(tmp_path: Path) -> None:
    tester = ready(tmp_path, seed=2)
    tester.take_off(10.0)
    tester.run_for(10.0)
    kill(tester, 4)
    tester.wait_until(lambda: not tester.status.armed, 60.0, "disarmed after the landing")
    assert not tester.simulation.wrecked
    tester.run_for(10.0)
    assert arming_result(tester) == common.MAV_RESULT_TEMPORARILY_REJECTED
    tester.run_for(0.5)
    assert any("Motor 4 failed; repair" in line and "COM_FAIL_ACK" in line for line in tester.lines)
    assert not tester.status.sensors_health & common.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS

    tester.autopilot.registry.set("COM_FAIL_ACK", 1)  # Acknowledged without a repair
    tester.run_for(1.0)
    assert tester.autopilot.registry.get("COM_FAIL_ACK") == 0
    assert arming_result(tester) == common.MAV_RESULT_ACCEPTED
    stays_on_ground(tester, 5.0)

    tester.simulation.clear_faults()  # Repaired
    tester.run_for(1.0)
    assert arming_result(tester) == common.MAV_RESULT_TEMPORARILY_REJECTED
    tester.autopilot.registry.set("COM_FAIL_ACK", 1)
    tester.run_for(1.0)
    tester.take_off(5.0)
    tester.run_for(8.0)
    assert tester.true_position()[2] > 4.5


def test_arming_by_force_does_not_lift_a_dead_motor(tmp_path: Path) -> None:
    tester = ready(tmp_path, seed=1)
    kill(tester, 3)
    tester.take_off(5.0)
    tester.run_for(3.0)
    tester.ground_station.command(common.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, 21196.0)
    tester.run_for(0.5)
    stays_on_ground(tester, 4.0)
