"""An abort of a vehicle that is not received: it is ordered for a while, then when it is again.

The link from the vehicle has failed, and the one to it may work.
"""

import dataclasses
from typing import Any, Final

import pytest

from afarcloud.enumerations import EventType, Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.abort_executor import STANDS, UNHEARD_S
from mavlink_broker.mission.states import State
from tests.support.broker_events import ABORT, POINT, answer_statuses, answers
from tests.support.broker_world import World, first_flight
from tests.support.mission_scenes import slow, state
from tests.support.orders import commands
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import ARDUPILOT, COPTER_LOITER, PX4, PX4_POSITION, Script

FAMILIES = pytest.mark.parametrize(
    ("script", "manual"),
    [(PX4, PX4_POSITION), (ARDUPILOT, COPTER_LOITER)],
    ids=["px4", "ardupilot"],
)
KINDS = pytest.mark.parametrize(
    ("kind", "place"),
    [(ABORT, {}), (ABORT, {"abort": POINT}), (EventType.RETURN_HOME, {})],
    ids=["land", "place", "return"],
)
LOST_S: Final = 8.0


def flying(script: Script) -> tuple[World, ScriptedVehicle]:
    """A vehicle that flies its mission."""
    world = World()
    vehicle = world.add_vehicle(script=slow(script))
    world.run(5.0)
    world.edge.plan(first_flight())
    world.run_until(lambda: vehicle.airborne and state(world) is State.RUNNING)
    world.run(2.0)
    return world, vehicle


def abort_unheard(world: World, kind: int, place: dict[str, Any]) -> int:
    """Order the abort of a vehicle that receives and is not received; gives the event."""
    world.air.is_downlink_up = False
    world.run(LOST_S)
    return world.edge.event(kind, **place)


@FAMILIES
@KINDS
def test_it_is_ordered_at_once(
    script: Script, manual: int, kind: int, place: dict[str, Any]
) -> None:
    del manual
    world, vehicle = flying(script)
    before = len(vehicle.frames)
    abort_unheard(world, kind, place)
    world.run(10.0)
    assert commands(vehicle, before)


@FAMILIES
@KINDS
def test_a_pilot_who_takes_it_over_later_keeps_it(
    script: Script, manual: int, kind: int, place: dict[str, Any]
) -> None:
    world, vehicle = flying(script)
    event = abort_unheard(world, kind, place)
    world.run(UNHEARD_S + 5.0)
    vehicle.set_mode(manual)
    before = len(vehicle.frames)
    world.run(60.0)
    world.air.is_downlink_up = True
    world.run(20.0)
    assert commands(vehicle, before) == []
    assert vehicle.custom_mode == manual
    assert answer_statuses(world, event)[-1] == ("refused" if vehicle.armed else "done")


@FAMILIES
@KINDS
def test_one_that_flies_on_is_ordered_again_when_it_is_received(
    script: Script, manual: int, kind: int, place: dict[str, Any]
) -> None:
    del manual
    world, _ = flying(script)
    world.air.is_uplink_up = False
    event = abort_unheard(world, kind, place)
    world.run(UNHEARD_S + 20.0)
    world.air.is_uplink_up = True
    world.air.is_downlink_up = True
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.ABORTED
    world.run_until(lambda: answer_statuses(world, event)[-1] == "done")


@FAMILIES
@pytest.mark.parametrize(("place", "note"), [({}, None), ({"abort": POINT}, STANDS)])
def test_one_that_was_last_heard_on_the_ground_lands(
    script: Script, manual: int, place: dict[str, Any], note: str | None
) -> None:
    """It has taken off unheard, and refuses to be disarmed in the air."""
    del manual
    world = World()
    vehicle = world.add_vehicle(script=slow(script))
    world.run(5.0)
    world.edge.plan(first_flight())
    world.run_until(lambda: vehicle.airborne)
    world.air.is_downlink_up = False
    vehicle.script = dataclasses.replace(
        vehicle.script,
        item_time_s=200.0,
        results={mavlink.MAV_CMD_COMPONENT_ARM_DISARM: mavlink.MAV_RESULT_DENIED},
    )
    world.run(LOST_S)
    event = world.edge.event(ABORT, **place)
    world.run(UNHEARD_S + 20.0)
    assert not vehicle.airborne
    world.air.is_downlink_up = True
    world.run_until(lambda: answers(world, event)[-1] == ("done", note))
    assert world.edge.status(1201) == Status.ABORTED
