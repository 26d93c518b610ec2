"""A broker that is killed between its order to arm and its order to start.

The scripted vehicle never disarms by itself, as with COM_DISARM_PRFLT or DISARM_DELAY off.
"""

from pathlib import Path

import pytest

from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.phases.attaching import MOST_DISARMINGS
from mavlink_broker.mission.states import State
from mavlink_broker.vehicle.armed_period import ARMED_BY_OTHERS
from tests.support.broker_world import FINISHED, World, first_flight
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import ARDUPILOT, PX4, PX4_POSITION, Script


def just_armed(
    journal: Path | None, *, script: Script = PX4, disk_lag_s: float = 0.0
) -> tuple[World, ScriptedVehicle]:
    """A world whose broker is killed as soon as its order has armed the vehicle."""
    world = World(journal=journal, disk_lag_s=disk_lag_s)
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(first_flight())
    world.run_until(lambda: vehicle.armed)
    world.kill_broker()
    return world, vehicle


def about_to_start(journal: Path, script: Script) -> tuple[World, ScriptedVehicle]:
    """A world whose broker is killed when it has noted the order to start, and not sent it."""
    world = World(journal=journal)
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(first_flight())
    world.run_until(lambda: any(one.state is State.STARTING for one in world.app.sessions.values()))
    world.kill_broker()
    assert not vehicle.in_mission
    return world, vehicle


def arming_orders(vehicle: ScriptedVehicle) -> list[float]:
    """First parameters of the orders to arm or to disarm."""
    kind = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
    frames = (one for one in vehicle.frames if one.get_type() == "COMMAND_LONG")
    return [one.param1 for one in frames if one.command == kind]


@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
@pytest.mark.parametrize(("away_s", "disk_lag_s"), [(0.0, 0.0), (3.0, 0.0), (3.0, 0.4)])
def test_its_own_vehicle_is_disarmed_and_the_mission_begins_anew(
    away_s: float, disk_lag_s: float, script: Script, tmp_path: Path
) -> None:
    world, vehicle = just_armed(tmp_path, script=script, disk_lag_s=disk_lag_s)
    world.run(away_s)
    world.restart_broker()
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == FINISHED
    assert arming_orders(vehicle)[:3] == [1.0, 0.0, 1.0]


@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
@pytest.mark.parametrize("away_s", [0.0, 3.0])
def test_one_that_was_to_be_ordered_to_start_is_disarmed_too(
    away_s: float, script: Script, tmp_path: Path
) -> None:
    world, vehicle = about_to_start(tmp_path, script)
    world.run(away_s)
    world.restart_broker()
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == FINISHED
    assert arming_orders(vehicle)[:3] == [1.0, 0.0, 1.0]


def test_one_that_disarms_by_no_order_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world, vehicle = about_to_start(tmp_path, PX4)
    obey = vehicle._obey
    is_disarming = (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)
    monkeypatch.setattr(
        vehicle, "_obey", lambda m: None if (m.command, m.param1) == is_disarming else obey(m)
    )
    world.restart_broker()
    world.run_until_over(1201)
    assert world.edge.reports(1201)[-1]["message"] == "not ready after 60 s: it is armed"
    assert arming_orders(vehicle) == [1.0] + [0.0] * MOST_DISARMINGS


def test_a_vehicle_that_was_ordered_to_arm_long_ago_may_be_anybodys(tmp_path: Path) -> None:
    """Most vehicles have disarmed by then; who arms one afterwards is somebody else."""
    world, vehicle = just_armed(tmp_path)
    world.run(11.0)
    world.restart_broker()
    world.run(60.0)
    assert world.edge.reports(1201)[-1]["message"] == ARMED_BY_OTHERS
    assert arming_orders(vehicle) == [1.0]


def test_a_pilot_who_has_it_meanwhile_is_not_disarmed(tmp_path: Path) -> None:
    world, vehicle = just_armed(tmp_path)
    vehicle.steer(PX4_POSITION)
    world.restart_broker()
    world.run(30.0)
    assert arming_orders(vehicle) == [1.0]
    assert world.edge.reports(1201)[-1]["message"] == ARMED_BY_OTHERS


def test_without_a_journal_it_is_somebody_elses() -> None:
    world, vehicle = just_armed(None)
    world.restart_broker()
    world.run(30.0)
    assert arming_orders(vehicle) == [1.0]
    assert world.edge.reports(1201)[-1]["message"] == ARMED_BY_OTHERS
