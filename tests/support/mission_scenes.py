"""Worlds in which a mission has come to some state: it flies, is paused, aborted, or waits.

Each function gives a world whose only vehicle flies mission 1201. A test continues from there: it
orders an event, has somebody take the vehicle, or kills the broker.
"""

import dataclasses
from pathlib import Path
from typing import Any, Final

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import OWN
from tests.support.broker_events import (
    ABORT,
    PAUSE,
    POINT,
    RETURN_HOME,
    SOFT_ABORT,
    answer,
    answer_statuses,
)
from tests.support.broker_world import (
    World,
    first_flight,
    follow,
    go_home,
    hotpoint,
    mission,
    takeoff,
    waypoint,
)
from tests.support.mission_reports import running
from tests.support.scripted_disk import DISK_LAG_S
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import PX4, Script

LONG_MISSION: Final = (
    takeoff(1),
    waypoint(2),
    hotpoint(3, radius=10.0, start_point=4),
    follow(4),
    go_home(5),
)
REFUSING_RETURN: Final = {
    mavlink.MAV_CMD_DO_SET_MODE: mavlink.MAV_RESULT_DENIED,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: mavlink.MAV_RESULT_DENIED,
    mavlink.MAV_CMD_NAV_LAND: mavlink.MAV_RESULT_DENIED,
}
"""MAV_RESULT per command, of a vehicle that refuses every way down."""
SONAR: Final = mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION


def state(world: World) -> State | None:
    """The state of the session of vehicle 1; None before there is a session."""
    session = world.app.sessions.get(1)
    return None if session is None else session.state


def slow(script: Script, **more: Any) -> Script:
    """The same vehicle, with 6 s for each item; it arrives at no place that is ordered live."""
    return dataclasses.replace(script, item_time_s=6.0, goes_to_places=False, **more)


def world_at(command: int, script: Script = OWN, journal: Path | None = None) -> World:
    """A world whose vehicle flies this command of a long mission."""
    world = World(journal=journal)
    world.add_vehicle(script=dataclasses.replace(script, item_time_s=6.0))
    world.edge.plan(mission(*LONG_MISSION))
    world.run_until(lambda: running(world) == command)
    world.run(1.0)
    return world


def in_mission(script: Script) -> World:
    """A vehicle that flies the items of its mission."""
    world = World()
    vehicle = world.add_vehicle(script=slow(script))
    world.edge.plan(mission(takeoff(1), waypoint(2, hold_time=60.0), go_home(3)))
    world.run_until(lambda: vehicle.airborne and state(world) is State.RUNNING)
    world.run(7.0)
    return world


def at_its_waypoint(script: Script, journal: Path | None = None) -> World:
    """A vehicle in the middle of its items, where its mission keeps it for a minute."""
    world = World(journal=journal)
    vehicle = world.add_vehicle(script=dataclasses.replace(script, item_time_s=60.0))
    world.edge.plan(mission(takeoff(1), waypoint(2, hold_time=60.0), waypoint(3)))
    world.run_until(lambda: vehicle.airborne and world.edge.status(1201) == Status.RUNNING)
    world.run(7.0)
    return world


def on_its_way_home(script: Script, journal: Path | None = None) -> World:
    """A vehicle whose mission returns it by its last command, and takes long for that."""
    world = World(journal=journal)
    world.add_vehicle(script=dataclasses.replace(script, item_time_s=30.0, landing_s=600.0))
    world.edge.plan(mission(takeoff(1), waypoint(2), go_home(3)))
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
    world.run_until(lambda: world.edge.statuses(1201)[-1] == Status.RUNNING, within_s=200.0)
    world.run(2.0)
    return world


def live(script: Script) -> World:
    """A vehicle that follows a target."""
    world = World()
    vehicle = world.add_vehicle(script=slow(script))
    world.edge.plan(mission(takeoff(1), follow(2), go_home(3)))
    world.run_until(lambda: vehicle.airborne and state(world) is State.FLYING_LIVE)
    world.run(2.0)
    return world


def starting(script: Script) -> World:
    """A vehicle that is armed, and has not yet accepted the order to start its mission."""
    world = World()
    denied = {mavlink.MAV_CMD_MISSION_START: mavlink.MAV_RESULT_IN_PROGRESS}
    vehicle = world.add_vehicle(script=slow(script, results=denied))
    world.edge.plan(first_flight())
    world.run_until(lambda: state(world) is State.STARTING)
    world.run(0.5)
    assert vehicle.armed
    return world


def paused(script: Script, journal: Path | None = None) -> World:
    """A world whose mission an event has paused within its items."""
    world = World(journal=journal)
    vehicle = world.add_vehicle(script=slow(script))
    world.edge.plan(mission(takeoff(1), waypoint(2, hold_time=60.0), go_home(3)))
    world.run_until(lambda: vehicle.airborne and state(world) is State.RUNNING)
    world.run(7.0)
    pause = world.edge.event(PAUSE)
    world.run(3.0)
    assert answer_statuses(world, pause) == ["accepted", "done"]
    return world


def paused_live(script: Script, journal: Path | None = None) -> World:
    """A world whose mission an event has paused while it followed a target."""
    world = World(journal=journal)
    vehicle = world.add_vehicle(script=slow(script))
    world.edge.plan(mission(takeoff(1), follow(2), go_home(3)))
    world.run_until(lambda: vehicle.airborne and state(world) is State.FLYING_LIVE)
    world.run(12.0)
    assert world.edge.statuses(1201)[1] == Status.RUNNING
    pause = world.edge.event(PAUSE)
    world.run(3.0)
    assert answer_statuses(world, pause) == ["accepted", "done"]
    return world


def going_to_a_point(script: Script) -> World:
    """A vehicle that an abort has sent to a point."""
    world = in_mission(script)
    world.edge.event(ABORT, abort=POINT)
    world.run(2.0)
    assert state(world) is State.ABORTING
    return world


def refusing_to_return(script: Script) -> World:
    """A vehicle that denies the return that a soft abort has ordered."""
    world = in_mission(script)
    world.only_vehicle.script = slow(script, results=REFUSING_RETURN)
    world.edge.event(SOFT_ABORT)
    world.run_until(lambda: state(world) is State.ABORTING)
    return world


def returning(journal: Path) -> tuple[World, ScriptedVehicle]:
    """A vehicle on its way home by an abort that is done; it never comes there by itself."""
    world = World(journal=journal)
    vehicle = world.add_vehicle(script=dataclasses.replace(PX4, landing_s=600.0))
    world.edge.plan(mission(takeoff(1), waypoint(2, hold_time=60.0), waypoint(3)))
    world.run_until(lambda: vehicle.airborne and world.edge.status(1201) == Status.RUNNING)
    world.run(5.0)
    event = world.edge.event(RETURN_HOME)
    world.run_until(lambda: world.edge.status(1201) == Status.ABORTED)
    world.run(1.0)
    assert answer(world, event)[0] == "done"
    return world, vehicle


def alarmed_world(folder: Path, script: Script = PX4, lag_s: float = DISK_LAG_S) -> World:
    """A world whose mission has just failed by an alarm; no frame reaches the vehicle."""
    world = World(journal=folder, disk_lag_s=lag_s)
    vehicle = world.add_vehicle(script=dataclasses.replace(script, item_time_s=60.0))
    world.edge.plan(mission(takeoff(), waypoint(), go_home()))
    world.run_until(lambda: vehicle.airborne)
    world.run(3.0)
    world.air.is_uplink_up = False
    vehicle.ill = SONAR
    world.run_until(lambda: world.app.sessions[1].state is State.ABORTING)
    return world


def hovering_after_its_mission(script: Script, journal: Path | None = None) -> World:
    """A vehicle that the broker keeps in the air where its mission has ended."""
    world = World(journal=journal)
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(mission(takeoff(1), waypoint(2)))
    world.run_until_over(1201)
    world.run(5.0)
    assert vehicle.armed
    return world


def hovering_before_an_upload(script: Script) -> World:
    """A vehicle that hovers after a mission, and is too busy to take the next one."""
    world = World()
    vehicle = world.add_vehicle(script=slow(script))
    world.edge.plan(mission(takeoff(1), waypoint(2)))
    world.run_until_over(1201)
    vehicle.missions.busy_until = world.clock.now + 60.0
    world.edge.plan(mission(waypoint(1, 20.0), go_home(2), mission_id=1202))
    world.run_until(lambda: state(world) is State.UPLOADING)
    world.run(1.0)
    return world


def flown(script: Script, plan: Any = None, *, loss: float = 0.0) -> World:
    """A world in which one mission is over."""
    world = World(loss=loss)
    world.add_vehicle(script=script)
    work = first_flight() if plan is None else plan
    world.edge.plan(work)
    world.run_until_over(work["mission_id"], within_s=900.0)
    return world


PHASES: Final = {
    "mission": in_mission,
    "abort flight to a point": going_to_a_point,
    "refused return": refusing_to_return,
    "live command": live,
    "upload in a hover": hovering_before_an_upload,
    "start": starting,
}
"""Scenes in which somebody may take the vehicle, by what the broker is doing."""
