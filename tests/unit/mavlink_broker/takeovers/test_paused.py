"""A ground station or a pilot pauses the vehicle: the broker lets it stay, and reports it.

PX4 pauses in the mode in which the broker has it wait (AUTO.LOITER): there the vehicle's
acknowledgement shows whose order it was, or that the mode of a live command was left.
"""

import dataclasses
from collections.abc import Callable

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import OWN
from tests.support.broker_events import ABORT, SOFT_ABORT, answer_statuses
from tests.support.broker_world import World, follow, go_home, hotpoint, mission, takeoff, waypoint
from tests.support.mission_scenes import PHASES, in_mission, live, slow, state
from tests.support.orders import SET_MODE, orders
from tests.support.other_parties import STATION
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_AUTO,
    COPTER_BRAKE,
    PX4,
    PX4_FOLLOW,
    PX4_HOLD,
    PX4_LAND,
    PX4_MISSION,
    PX4_ORBIT,
    Script,
)

REPOSITION = mavlink.MAV_CMD_DO_REPOSITION
BOTH = pytest.mark.parametrize("script", [PX4, OWN], ids=["px4", "own"])


def pause(world: World, *, by_station: bool = True) -> int:
    """Pause it as QGroundControl does, or by a switch; gives how much it was sent before."""
    vehicle = world.only_vehicle
    if by_station:
        accepted = mavlink.MAV_RESULT_ACCEPTED
        vehicle.send(mavlink.MAVLink_command_ack_message(REPOSITION, accepted, 0, 0, STATION, 190))
    vehicle.set_mode(PX4_HOLD)
    world.run(0.1)
    return len(vehicle.frames)


@pytest.mark.first_case
@BOTH
@pytest.mark.parametrize("phase", PHASES.values(), ids=PHASES)
def test_nothing_is_ordered_behind_a_pause_of_a_ground_station(
    phase: Callable[[Script], World], script: Script
) -> None:
    world = phase(script)
    vehicle = world.only_vehicle
    since = pause(world)
    world.run(40.0)
    assert orders(vehicle, since) == []
    assert vehicle.custom_mode == PX4_HOLD
    report = world.edge.bodies("/mission_report/")[-1]
    texts = [report.get("message"), *(c.get("message") for c in report["command_report_array"])]
    texts += [a.get("message") for a in world.edge.acknowledgements(2) if 2 in world.edge.work]
    assert any(f"system {STATION} " in (text or "") for text in texts), texts
    assert (report["mission_status_id"] == Status.RUNNING) == (phase is in_mission)


@pytest.mark.first_case
@BOTH
@pytest.mark.parametrize("by_station", [False, True])
def test_items_that_are_paused_go_on_when_they_are_resumed(
    script: Script, *, by_station: bool
) -> None:
    world = in_mission(script)
    since = pause(world, by_station=by_station)
    world.run(100.0)
    assert orders(world.only_vehicle, since) == []
    assert world.edge.status(1201) == Status.RUNNING
    who = f"system {STATION}" if by_station else "somebody else"
    messages = [c.get("message") for c in world.edge.reports(1201)[-1]["command_report_array"]]
    assert f"{who} paused the vehicle: mode AUTO.LOITER" in messages
    world.only_vehicle.set_mode(PX4_MISSION)
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FINISHED


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("script", "modes"),
    [(PX4, (PX4_HOLD, PX4_MISSION)), (ARDUPILOT, (COPTER_BRAKE, COPTER_AUTO))],
    ids=["px4", "ardupilot"],
)
def test_a_mission_that_is_resumed_just_before_a_live_command_goes_on(
    script: Script, modes: tuple[int, int]
) -> None:
    """The order that resumes it is no pause of what the broker orders a second later."""
    world = World()
    vehicle = world.add_vehicle(script=slow(script))
    world.edge.plan(mission(takeoff(1), waypoint(2), follow(3), go_home(4)))
    world.run_until(lambda: vehicle.airborne and state(world) is State.RUNNING)
    world.run_until(lambda: vehicle.items[vehicle.current].command == mavlink.MAV_CMD_NAV_WAYPOINT)
    for mode in modes:
        acknowledged = mavlink.MAVLink_command_ack_message(SET_MODE, 0, 0, 0, STATION, 190)
        vehicle.send(acknowledged)
        vehicle.set_mode(mode)
        world.run(8.0 if mode == modes[0] else 0.1)
    vehicle.script = dataclasses.replace(vehicle.script, item_time_s=0.2)
    world.run_until(lambda: state(world) is not State.RUNNING, 2.0)
    world.run(8.0)
    assert state(world) is State.FLYING_LIVE, world.edge.reports(1201)[-1]


def test_an_order_of_the_vehicle_to_itself_is_no_pause() -> None:
    """PX4's modules order modes of it, and these are acknowledged to everybody as well."""
    world = live(PX4)
    own = mavlink.MAVLink_command_ack_message(REPOSITION, 0, 0, 0, world.only_vehicle.system, 1)
    world.only_vehicle.send(own)
    world.run(3.0)
    assert state(world) is State.FLYING_LIVE


def circling(script: Script) -> World:
    """A world whose vehicle has flown a tenth of its circle."""
    world = World()
    vehicle = world.add_vehicle(script=slow(script))
    world.edge.plan(mission(takeoff(1), hotpoint(2, radius=30.0, start_point=4), go_home(3)))
    world.run_until(lambda: vehicle.circle is not None)
    circle = vehicle.circle
    assert circle is not None
    world.run_until(lambda: circle.flown_rad > 0.6)
    return world


@pytest.mark.first_case
@BOTH
@pytest.mark.parametrize("phase", [live, circling], ids=["follow", "circle"])
def test_a_live_command_that_a_pilot_pauses_by_a_switch_has_failed(
    phase: Callable[[Script], World], script: Script
) -> None:
    """No circle is over because its vehicle holds before it has gone round."""
    world = phase(script)
    vehicle = world.only_vehicle
    world.run_until(lambda: vehicle.custom_mode in {PX4_FOLLOW, PX4_ORBIT})
    world.run(1.0)
    since = pause(world, by_station=False)
    world.run(80.0)
    assert orders(vehicle, since) == []
    assert vehicle.custom_mode == PX4_HOLD
    assert world.edge.statuses(1201) == [Status.FINISHED, Status.FAILED, Status.ABORTED]
    assert "AUTO.LOITER" in world.edge.reports(1201)[-1]["message"]


class TestAnEvent:
    """What is newer decides: the pause over a soft abort that waited, an abort over the pause."""

    @pytest.mark.first_case
    @pytest.mark.parametrize("by_station", [False, True])
    def test_that_waited_does_not_end_the_pause(self, *, by_station: bool) -> None:
        world = in_mission(PX4)
        event = world.edge.event(SOFT_ABORT)
        world.run(1.0)
        since = pause(world, by_station=by_station)
        world.run(50.0)
        assert orders(world.only_vehicle, since) == []
        assert world.edge.status(1201) == Status.ABORTED
        assert answer_statuses(world, event) == ["accepted", "refused"]
        assert "paused the vehicle" in world.edge.acknowledgements(event)[-1]["message"]

    @pytest.mark.parametrize("by_station", [False, True])
    def test_that_comes_later_is_carried_out(self, *, by_station: bool) -> None:
        world = in_mission(PX4)
        pause(world, by_station=by_station)
        world.run(5.0)
        event = world.edge.event(ABORT)
        world.run(2.0)
        assert world.only_vehicle.custom_mode == PX4_LAND
        assert answer_statuses(world, event) == ["accepted", "done"]
        world.run(1.0)
        assert state(world) is State.IDLE


def test_a_hover_that_a_ground_station_has_moved_is_no_hover_of_the_broker() -> None:
    world = World()
    vehicle = world.add_vehicle()
    world.edge.plan(mission(takeoff(1)))
    world.run_until_over(1201)
    world.run(1.0)
    since = pause(world)
    world.edge.plan(mission(go_home(1), mission_id=1202))
    world.run(10.0)
    assert orders(vehicle, since) == []
    assert world.edge.status(1202) is None
