"""A broker that is killed when the vehicle has obeyed an order which it has not seen obeyed."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import EventType
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import PX4_AND_ARDUPILOT
from tests.support.broker_events import ABORT, POINT, answer_statuses
from tests.support.broker_world import World, first_flight, mission, takeoff, waypoint
from tests.support.mission_scenes import returning
from tests.support.vehicle_script import COPTER_RETURN, PX4_LAND, PX4_RETURN, Script

FIRST_ORDER = pytest.mark.parametrize(
    ("kind", "place"),
    [(ABORT, {}), (EventType.RETURN_HOME, {}), (ABORT, {"abort": POINT})],
    ids=["land", "return", "land-there"],
)
IS_KNOWN = pytest.mark.parametrize("is_known", [True, False], ids=["accepted", "queued"])
SECOND_AFTER = pytest.mark.parametrize("second_after_s", [0.0, 1.0, 6.0])


def flying(folder: Path, script: Script) -> World:
    world = World(journal=folder)
    vehicle = world.add_vehicle(script=replace(script, item_time_s=6.0, landing_s=20.0))
    world.edge.plan(mission(takeoff(), waypoint(2, hold_time=60.0), waypoint(3)))
    world.run_until(lambda: vehicle.airborne)
    world.run(4.0)
    return world


def is_waiting_for_others(world: World) -> bool:
    """Whether the broker has reported that the vehicle has to stand because somebody had it."""
    return any("failsafe had it" in (b["warning"] or "") for b in world.edge.bodies("/vehicles/1"))


def lose_acceptance(world: World, event: int) -> None:
    """Let the edge server not know of an acceptance: the broker was killed before it was sent."""
    world.edge.work[event]["state"] = "queued"
    world.edge.closed.discard(event)


@pytest.mark.first_case
@PX4_AND_ARDUPILOT
@FIRST_ORDER
@SECOND_AFTER
@IS_KNOWN
def test_a_newer_abort_is_carried_out_and_the_vehicle_is_the_brokers(
    script: Script,
    kind: int,
    place: dict[str, Any],
    second_after_s: float,
    tmp_path: Path,
    *,
    is_known: bool,
) -> None:
    world = flying(tmp_path, script)
    first = world.edge.event(kind, **place)
    world.run(0.2)
    world.kill_broker()
    if not is_known:
        lose_acceptance(world, first)
    world.restart_broker()
    world.run(second_after_s)
    second = world.edge.event(ABORT)
    world.run_until(lambda: not world.only_vehicle.armed)
    world.run(2.0)
    assert answer_statuses(world, first)[-1] == "done"
    assert answer_statuses(world, second)[-1] == "done"
    assert not is_waiting_for_others(world)


@IS_KNOWN
@pytest.mark.parametrize("away_s", [0.0, 2.0, 6.0])
def test_an_abort_that_was_ordered_during_a_return_is_carried_on(
    away_s: float, tmp_path: Path, *, is_known: bool
) -> None:
    """It flies to a place, in the mode in which somebody else would have stopped the return."""
    world, vehicle = returning(tmp_path)
    event = world.edge.event(ABORT, abort=POINT)
    world.run_until(lambda: vehicle.custom_mode != PX4_RETURN)
    world.kill_broker()
    if not is_known:
        lose_acceptance(world, event)
    world.run(away_s)
    world.restart_broker()
    world.run_until(lambda: vehicle.custom_mode == PX4_LAND)
    world.run(2.0)
    assert vehicle.place == pytest.approx((POINT["latitude"], POINT["longitude"]))
    assert answer_statuses(world, event)[-2:] == ["accepted", "done"]


@PX4_AND_ARDUPILOT
def test_the_return_of_an_alarm_is_the_brokers_for_a_newer_abort(
    script: Script, tmp_path: Path
) -> None:
    world = flying(tmp_path, script)
    vehicle = world.only_vehicle
    vehicle.ill = mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION
    world.run_until(lambda: world.app.sessions[1].state is State.ABORTING)
    world.run_until(lambda: vehicle.custom_mode in {PX4_RETURN, COPTER_RETURN})
    world.run(0.1)
    world.restart_broker()
    world.run(6.0)
    abort = world.edge.event(ABORT)
    world.edge.plan(first_flight(mission_id=1202))
    world.run_until(lambda: not vehicle.armed)
    world.run(2.0)
    assert answer_statuses(world, abort)[-1] == "done"
    assert not is_waiting_for_others(world)
