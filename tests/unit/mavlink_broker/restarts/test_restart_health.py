"""A part of the vehicle that fails while the broker is away, or its link."""

from pathlib import Path

import pytest

from afarcloud.enumerations import AlarmCode, AlarmType, Status
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.autopilot_families import SLOW_PX4
from tests.support.broker_world import World, first_flight, flying_world
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import PX4_LAND

MOTORS = mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
ALARM = (AlarmType.EQUIPMENT_FAILURE, AlarmCode.EQUIPMENT_PROPELLERS, "motor failed")
LEFT = "the vehicle left the mission: mode AUTO.LAND: its own failsafe flies it"
PARTS = "; unhealthy now: motor failed"


def flight(journal: Path | None = None) -> tuple[World, ScriptedVehicle]:
    world = World(journal=journal)
    vehicle = world.add_vehicle(script=SLOW_PX4)
    world.edge.plan(first_flight())
    world.run_until(lambda: vehicle.airborne)
    world.run(8.0)
    return world, vehicle


def fall(world: World, vehicle: ScriptedVehicle) -> None:
    """A motor fails, and the vehicle's own failsafe lands it."""
    vehicle.ill = MOTORS
    vehicle.fail_safe(PX4_LAND)
    world.run_until(lambda: not vehicle.armed)


def alarms(world: World) -> set[tuple[int, int, str]]:
    bodies = world.edge.bodies("/alarm/")
    return {(one["alarm_type_id"], one["alarm_code_id"], one["message"]) for one in bodies}


def message(world: World) -> str:
    text: str = world.edge.reports(1201)[-1]["message"]
    return text


def test_it_is_an_alarm_though_the_vehicle_has_landed_meanwhile(tmp_path: Path) -> None:
    world, vehicle = flight(tmp_path)
    world.kill_broker()
    fall(world, vehicle)
    world.restart_broker()
    world.run_until_over(1201)
    world.run(5.0)
    assert alarms(world) == {ALARM}
    assert world.edge.status(1201) == Status.FAILED
    world.run(60.0)
    assert len(world.edge.bodies("/alarm/")) == 1
    assert message(world) == LEFT + PARTS


def test_it_is_an_alarm_when_the_link_was_away_until_the_vehicle_had_landed() -> None:
    world, vehicle = flight()
    world.air.is_downlink_up = False
    world.run(8.0)
    fall(world, vehicle)
    world.air.is_downlink_up = True
    world.run_until_over(1201)
    world.run(5.0)
    assert alarms(world) == {ALARM}


def test_without_a_journal_the_report_names_what_is_unhealthy() -> None:
    world, vehicle = flight()
    world.kill_broker()
    fall(world, vehicle)
    world.restart_broker()
    world.run_until_over(1201)
    assert alarms(world) == set()
    assert message(world) == LEFT + PARTS


@pytest.mark.parametrize("ill", [MOTORS, 0])
def test_the_report_names_it_while_the_failsafe_flies(ill: int) -> None:
    world, vehicle = flight()
    world.kill_broker()
    vehicle.ill = ill
    vehicle.fail_safe(PX4_LAND)
    world.restart_broker()
    world.run_until_over(1201)
    assert message(world) == LEFT + (PARTS if ill else "")


def test_one_that_was_off_since_has_its_parts_judged_anew(tmp_path: Path) -> None:
    world, vehicle = flight(tmp_path)
    world.kill_broker()
    vehicle.reboot(world.clock.now)
    vehicle.ill = MOTORS
    world.restart_broker()
    world.run_until_over(1201)
    world.run(10.0)
    assert ALARM not in alarms(world)
    assert message(world) == "the vehicle was restarted"


def test_a_flight_that_the_broker_has_followed_names_no_parts() -> None:
    """Their alarms were raised, and end the mission."""
    world = flying_world(SLOW_PX4)
    world.run(8.0)
    world.only_vehicle.ill = mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    world.only_vehicle.fail_safe(PX4_LAND)
    world.run_until_over(1201)
    assert "unhealthy" not in message(world)
