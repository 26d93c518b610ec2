"""Somebody else takes the vehicle: from then on the broker sends no order, whatever it was doing.

Every phase of a mission, every family of autopilots, several kinds of takeover. What counts is
what arrives at the vehicle: heartbeats and questions may, nothing else.
"""

import dataclasses
from collections.abc import Callable
from typing import Final

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import OWN
from tests.support.broker_events import ABORT, POINT, RETURN_HOME, SOFT_ABORT, answer_statuses
from tests.support.broker_world import (
    GENERIC,
    World,
    first_flight,
    go_home,
    mission,
    takeoff,
    waypoint,
)
from tests.support.mission_scenes import PHASES, going_to_a_point, in_mission, live, slow, state
from tests.support.orders import orders
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_AUTO,
    COPTER_LOITER,
    COPTER_RETURN,
    COPTER_STABILIZE,
    PX4,
    PX4_HOLD,
    PX4_LAND,
    PX4_MISSION,
    PX4_POSITION,
    PX4_RETURN,
    PX4_STABILIZED,
    Script,
)

TAKEOVERS: Final = [
    pytest.param(PX4, PX4_POSITION, id="px4-posctl"),
    pytest.param(PX4, PX4_STABILIZED, id="px4-stabilized"),
    pytest.param(OWN, PX4_POSITION, id="own-posctl"),
    pytest.param(ARDUPILOT, COPTER_STABILIZE, id="ardupilot-stabilize"),
    pytest.param(ARDUPILOT, COPTER_LOITER, id="ardupilot-loiter"),
    pytest.param(GENERIC, 77, id="generic-manual"),
]


@pytest.mark.first_case
@pytest.mark.parametrize(("script", "mode"), TAKEOVERS)
@pytest.mark.parametrize("phase", PHASES.values(), ids=PHASES)
def test_no_order_is_sent_after_a_takeover(
    phase: Callable[[Script], World], script: Script, mode: int
) -> None:
    world = phase(script)
    vehicle = world.only_vehicle
    vehicle.steer(mode)
    world.tick()
    world.tick()
    since = len(vehicle.frames)
    world.run(4.0)
    vehicle.place = POINT["latitude"], POINT["longitude"]  # The pilot hovers where it was sent
    world.run(8.0)
    assert orders(vehicle, since) == []
    assert vehicle.custom_mode == mode
    reports = world.edge.bodies("/mission_report/")
    assert Status(reports[-1]["mission_status_id"]) in {Status.FAILED, Status.ABORTED} or (
        mode == COPTER_LOITER and phase is in_mission  # Paused: it may be resumed
    )


@pytest.mark.first_case
@pytest.mark.parametrize(("script", "mode"), TAKEOVERS)
def test_an_abort_behind_a_takeover_ends_the_mission_and_orders_nothing(
    script: Script, mode: int
) -> None:
    world = in_mission(script)
    vehicle = world.only_vehicle
    vehicle.steer(mode)
    world.run(1.0)
    since = len(vehicle.frames)
    event = world.edge.event(ABORT)
    world.run(15.0)
    assert orders(vehicle, since) == []
    assert world.edge.status(1201) == Status.ABORTED
    assert answer_statuses(world, event)[-1] == "refused"
    assert "somebody else flies the vehicle" in world.edge.acknowledgements(event)[-1]["message"]


@pytest.mark.first_case
@pytest.mark.parametrize(("script", "mode"), TAKEOVERS[:-1])  # Unknown modes show by a change
@pytest.mark.parametrize("phase", [in_mission, live, going_to_a_point])
def test_no_order_is_sent_by_a_broker_that_begins_after_a_takeover(
    phase: Callable[[Script], World], script: Script, mode: int
) -> None:
    world = phase(script)
    vehicle = world.only_vehicle
    world.kill_broker()
    world.run(1.0)
    vehicle.steer(mode)
    since = len(vehicle.frames)
    world.restart_broker()
    world.run(12.0)
    assert orders(vehicle, since) == []


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("script", "mode"), [(PX4, PX4_POSITION), (OWN, PX4_POSITION), (ARDUPILOT, COPTER_STABILIZE)]
)
def test_a_broker_that_begins_after_a_takeover_reports_it(script: Script, mode: int) -> None:
    """As soon as one that was there; the pilot who resumes the mission later flies it himself."""
    world = in_mission(script)
    vehicle = world.only_vehicle
    world.kill_broker()
    vehicle.steer(mode)
    since = len(vehicle.frames)
    world.restart_broker()
    world.run(15.0)
    assert world.edge.status(1201) == Status.FAILED
    assert "somebody else flies the vehicle" in world.edge.reports(1201)[-1]["message"]
    vehicle.is_manual = False
    vehicle.set_mode(COPTER_RETURN if script is ARDUPILOT else PX4_RETURN)
    event = world.edge.event(ABORT)
    world.run(5.0)
    assert orders(vehicle, since) == []
    assert answer_statuses(world, event)[-1] == "refused"


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("script", "mode", "home"),
    [
        (PX4, PX4_POSITION, PX4_RETURN),
        (OWN, PX4_POSITION, PX4_LAND),
        (ARDUPILOT, COPTER_STABILIZE, COPTER_RETURN),
    ],
)
@pytest.mark.parametrize("seen_s", [0.2, 1.5])
def test_a_return_that_a_pilot_chooses_after_a_restart_is_his(
    script: Script, mode: int, home: int, seen_s: float
) -> None:
    world = in_mission(script)
    vehicle = world.only_vehicle
    world.kill_broker()
    vehicle.steer(mode)
    since = len(vehicle.frames)
    world.restart_broker()
    world.run(seen_s)
    vehicle.is_manual = False
    vehicle.set_mode(home)
    event = world.edge.event(ABORT)  # Before anything else shows whose the return is
    world.run(5.0)
    assert orders(vehicle, since) == []
    assert vehicle.custom_mode == home
    assert answer_statuses(world, event)[-1] == "refused"


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("script", "mode", "resumed"),
    [
        (PX4, PX4_POSITION, PX4_MISSION),
        (OWN, PX4_STABILIZED, PX4_MISSION),
        (ARDUPILOT, COPTER_STABILIZE, COPTER_AUTO),
    ],
)
@pytest.mark.parametrize("restarts", ["never", "before he resumes", "behind that"])
def test_a_mission_that_a_pilot_resumes_after_his_takeover_is_his(
    script: Script, mode: int, resumed: int, restarts: str
) -> None:
    """It has failed by then; he flies its items, and the report stays what it is."""
    world = in_mission(script)
    vehicle = world.only_vehicle
    vehicle.steer(mode)
    world.run(8.0)
    assert world.edge.status(1201) == Status.FAILED
    since = len(vehicle.frames)
    if restarts == "before he resumes":
        world.restart_broker()
        world.run(1.0)
    vehicle.is_manual = False
    vehicle.set_mode(resumed)
    if restarts == "behind that":
        world.restart_broker()
    world.run(4.0)
    event = world.edge.event(ABORT)
    world.edge.plan(first_flight(mission_id=1202))
    world.run(4.0)
    assert vehicle.custom_mode == resumed
    assert orders(vehicle, since) == []
    assert answer_statuses(world, event) == ["refused"]
    ends = [r for r in world.edge.reports(1201) if r["mission_status_id"] >= Status.FINISHED]
    assert [r["mission_status_id"] for r in ends] == [Status.FAILED]
    assert "somebody else flies the vehicle" in ends[0]["message"]


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("script", "mode", "resumed"),
    [(PX4, PX4_POSITION, PX4_MISSION), (ARDUPILOT, COPTER_STABILIZE, COPTER_AUTO)],
)
def test_a_mission_that_is_resumed_within_seconds_goes_on_also_for_a_new_broker(
    script: Script, mode: int, resumed: int
) -> None:
    world = in_mission(script)
    vehicle = world.only_vehicle
    vehicle.steer(mode)
    since = len(vehicle.frames)
    world.run(1.0)
    world.restart_broker()
    world.run(2.0)
    assert orders(vehicle, since) == []
    vehicle.is_manual = False
    vehicle.set_mode(resumed)
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FINISHED


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("script", "mode", "resumed"),
    [
        (PX4, PX4_POSITION, PX4_MISSION),
        (OWN, PX4_POSITION, PX4_MISSION),
        (ARDUPILOT, COPTER_STABILIZE, COPTER_AUTO),
    ],
)
@pytest.mark.parametrize("is_set_back", [False, True])
def test_what_a_pilot_has_set_back_while_no_broker_ran_is_noted(
    script: Script, mode: int, resumed: int, *, is_set_back: bool
) -> None:
    """A takeover that is over leaves no other sign: the mission that he resumed goes on."""
    world = World()
    vehicle = world.add_vehicle(script=slow(script))
    last = go_home(5)
    world.edge.plan(
        mission(takeoff(1), waypoint(2), waypoint(3, north_m=20), waypoint(4, north_m=30), last)
    )
    world.run_until(lambda: world.edge.reports(1201) and world.edge.statuses(1201)[2] == 3)
    world.kill_broker()
    vehicle.steer(mode)
    world.run(10.0)
    vehicle.is_manual = False
    if is_set_back:
        waypoint_item = mavlink.MAV_CMD_NAV_WAYPOINT
        legs = [n for n, item in enumerate(vehicle.items) if item.command == waypoint_item]
        vehicle.current = legs[-4]
    vehicle.set_mode(resumed)
    world.restart_broker()
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.FINISHED] * 5
    texts = [
        command.get("message") or ""
        for report in world.edge.reports(1201)
        for command in report["command_report_array"]
    ]
    assert any("set the vehicle back to item" in text for text in texts) == is_set_back


def test_a_takeover_of_an_abort_is_reported() -> None:
    world = in_mission(PX4)
    event = world.edge.event(ABORT, abort=POINT)
    world.run(2.0)
    world.only_vehicle.steer(PX4_POSITION)
    world.run(1.0)
    assert answer_statuses(world, event) == ["accepted", "refused"]
    message = world.edge.acknowledgements(event)[-1]["message"]
    assert message == "the vehicle left the mission: mode POSCTL: somebody else flies the vehicle"
    assert state(world) is State.IDLE


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("script", "mode"), [(PX4, PX4_RETURN), (PX4, PX4_LAND), (ARDUPILOT, COPTER_RETURN)]
)
@pytest.mark.parametrize("phase", [going_to_a_point, live])
def test_a_failsafe_gets_no_order_and_differs_from_a_pilot(
    phase: Callable[[Script], World], script: Script, mode: int
) -> None:
    world = phase(script)
    vehicle = world.only_vehicle
    vehicle.fail_safe(mode)
    world.tick()
    world.tick()
    since = len(vehicle.frames)
    world.run(6.0)
    assert orders(vehicle, since) == []
    texts = [body.get("message") or "" for body in world.edge.bodies("/mission_report/")]
    texts += [a.get("message") or "" for a in world.edge.acknowledgements(2)]
    assert any("its own failsafe" in text for text in texts)


def test_a_pilot_who_resumes_the_mission_within_seconds_has_not_ended_it() -> None:
    world = in_mission(PX4)
    vehicle = world.only_vehicle
    vehicle.steer(PX4_POSITION)
    world.run(3.0)
    vehicle.is_manual = False
    vehicle.set_mode(PX4_MISSION)
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FINISHED


def test_an_upload_to_a_vehicle_that_somebody_arms_is_cancelled() -> None:
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(PX4, busy_for_s=20.0))
    world.run(2.0)
    world.edge.plan(first_flight())
    world.run_until(lambda: state(world) is State.UPLOADING)
    vehicle.armed = True
    vehicle.steer(PX4_POSITION)
    world.run(0.1)
    since = len(vehicle.frames)
    world.run_until_over(1201)
    world.run(5.0)
    assert orders(vehicle, since) == []
    assert "somebody else" in world.edge.reports(1201)[-1]["message"]


def test_a_hover_that_a_pilot_has_left_is_no_hover_of_the_broker() -> None:
    """He flies on, holds somewhere, and the next mission waits until he has landed."""
    world = World()
    vehicle = world.add_vehicle(script=PX4)
    world.edge.plan(mission(takeoff(1), waypoint(2)))
    world.run_until_over(1201)
    world.run(2.0)
    vehicle.steer(PX4_POSITION)
    world.run(2.0)
    vehicle.is_manual = False
    vehicle.set_mode(PX4_HOLD)
    since = len(vehicle.frames)
    world.edge.plan(mission(waypoint(1, 20.0), go_home(2), mission_id=1202))
    world.run(10.0)
    assert orders(vehicle, since) == []
    assert world.edge.status(1202) is None


def test_overridden_parameters_are_restored_when_the_pilot_has_landed() -> None:
    script = dataclasses.replace(slow(PX4), link_loss_action=2, settings={"COM_DL_LOSS_T": 10.0})
    world = World()
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(mission(takeoff(1), waypoint(2), go_home(3)))
    world.run_until(lambda: vehicle.airborne)
    assert vehicle.settings["COM_DL_LOSS_T"] == 90.0
    vehicle.steer(PX4_POSITION)
    world.run(20.0)
    assert vehicle.settings["COM_DL_LOSS_T"] == 90.0
    vehicle.armed = vehicle.airborne = False
    world.run(10.0)
    assert vehicle.settings["COM_DL_LOSS_T"] == 10.0


@pytest.mark.first_case
@pytest.mark.parametrize("kind", [ABORT, SOFT_ABORT, RETURN_HOME])
@pytest.mark.parametrize(
    ("script", "mode"), [(PX4, PX4_POSITION), (OWN, PX4_POSITION), (ARDUPILOT, COPTER_STABILIZE)]
)
def test_an_abort_while_a_takeover_fails_the_mission_orders_nothing(
    script: Script, mode: int, kind: int
) -> None:
    """The failure waits half a second for the vehicle's reasons; the abort comes meanwhile."""
    world = in_mission(script)
    vehicle = world.only_vehicle
    vehicle.steer(mode)
    world.run_until(lambda: state(world) is State.FAILING)
    since = len(vehicle.frames)
    event = world.edge.event(kind)
    world.run(30.0)
    assert orders(vehicle, since) == []
    assert vehicle.custom_mode == mode
    assert answer_statuses(world, event)[-1] == "refused"
