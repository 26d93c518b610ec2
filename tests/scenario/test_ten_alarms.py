"""Faults of the simulated vehicle, ten alarms: each the right one, and that one alone."""

from pathlib import Path
from typing import NamedTuple

import pytest

from afarcloud.enumerations import AlarmCode, Status
from afarcloud.geodesy import shifted
from sim.fault_schedule import Fault
from sim.faults.notation import read_order
from tests.support.broker_world import go_home, mission, takeoff, waypoint
from tests.support.flying_world import FlyingWorld
from tests.support.vehicle_script import HOME

pytestmark = pytest.mark.scenario

FLIGHT = 1201
AFTERWARDS_S = 6.0


class Case(NamedTuple):
    """What is broken by which line, and as what it is reported."""

    order: str
    code: AlarmCode
    is_fenced: bool = True


CASES = (
    Case("rangefinder_loss", AlarmCode.EQUIPMENT_SONAR),
    Case("motor_loss motor=2", AlarmCode.EQUIPMENT_PROPELLERS),
    Case("gyro_loss", AlarmCode.EQUIPMENT_IMU),
    Case("camera_failure", AlarmCode.EQUIPMENT_CAMERA),
    Case("gps_loss", AlarmCode.EQUIPMENT_GPS),
    Case("humidity_failure", AlarmCode.EQUIPMENT_HUMIDITY_SENSOR),
    Case("gps_frozen", AlarmCode.FUNCTION_LOCALISATION),
    Case("propulsion_weak", AlarmCode.FUNCTION_PROPULSION),
    Case("wind_gust speed_m_s=18", AlarmCode.FUNCTION_NAVIGATION, is_fenced=False),
    Case("gps_jump north_m=40 east_m=40", AlarmCode.EQUIPMENT_GPS),
    Case("humidity_invalid", AlarmCode.FUNCTION_HUMIDITY_SENSING),
)


def place(north_m: float, east_m: float) -> tuple[float, float]:
    latitude, _ = shifted(*HOME[:2], 0.0, north_m)
    _, longitude = shifted(*HOME[:2], 90.0, east_m)
    return latitude, longitude


FIELD = [place(-30, -30), place(-30, 60), place(60, 60), place(60, -30)]


def on_its_way(folder: Path, *, is_fenced: bool) -> FlyingWorld:
    """A vehicle on a long leg of its mission, inside the plan's fence if it has one."""
    world = FlyingWorld(folder, with_camera=True)
    corners = [
        waypoint(number, latitude=latitude, longitude=longitude)
        for number, (latitude, longitude) in enumerate(
            (place(40, 0), place(40, 40), place(0, 40), place(0, 0)), start=2
        )
    ]
    fence = {"inclusion": [FIELD], "exclusion": [], "max_altitude": 60.0}
    flown = mission(takeoff(), *corners, go_home(6))
    world.edge.plan(flown, geofence=fence if is_fenced else None)
    world.run_until(lambda: world.place[0] > 5.0)
    return world


def alarms(world: FlyingWorld) -> list[int]:
    return [alarm["alarm_code_id"] for alarm in world.edge.bodies("/alarm/")]


@pytest.mark.first_case
@pytest.mark.promise
@pytest.mark.parametrize("case", CASES, ids=[case.order for case in CASES])
def test_a_fault_raises_its_alarm_and_no_other(tmp_path: Path, case: Case) -> None:
    world = on_its_way(tmp_path, is_fenced=case.is_fenced)
    assert alarms(world) == []
    for line in lines(case.order):
        fault = read_order(line, world.simulation.time_us)
        assert isinstance(fault, Fault)
        world.simulation.add_fault(fault)
    world.run_until(lambda: alarms(world), within_s=60.0)
    world.run_until_over(FLIGHT, within_s=5.0)
    world.run(AFTERWARDS_S)
    assert alarms(world) == [case.code]
    statuses = world.edge.statuses(FLIGHT)
    failed = statuses.index(Status.FAILED)
    assert set(statuses[:failed]) <= {Status.FINISHED}
    assert set(statuses[failed + 1 :]) == {Status.ABORTED}
    assert world.edge.status(FLIGHT) == Status.FAILED


def lines(order: str) -> list[str]:
    """The orders of a case; a weak propulsion is four weak motors."""
    if order != "propulsion_weak":
        return [order]
    return [f"motor_loss motor={motor} efficiency=0.6" for motor in range(1, 5)]
