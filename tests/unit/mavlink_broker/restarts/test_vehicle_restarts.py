"""A vehicle that is restarted in the air gets no order: its mission is over."""

from dataclasses import replace
from pathlib import Path

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Route, mavlink
from mavlink_broker.mission.states import State
from mavlink_broker.vehicle.vehicle import Vehicle
from tests.support.autopilot_families import PX4_AND_ARDUPILOT
from tests.support.broker_events import ABORT, POINT, answer_statuses
from tests.support.broker_world import World, first_flight
from tests.support.mission_scenes import alarmed_world, going_to_a_point, state, world_at
from tests.support.orders import orders
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_GUIDED,
    PX4,
    PX4_HOLD,
    PX4_MISSION,
    Script,
)

FLOWN_ON = pytest.mark.parametrize(
    ("script", "mode"),
    [(PX4, PX4_HOLD), (PX4, PX4_MISSION), (ARDUPILOT, COPTER_GUIDED)],
    ids=["px4-hold", "px4-mission", "ardupilot-guided"],
)


def restart_in_the_air(world: World, mode: int) -> None:
    """Somebody else flies the vehicle afterwards, in a mode that the broker orders too."""
    vehicle = world.only_vehicle
    vehicle.reboot(world.clock.now)
    vehicle.armed = vehicle.airborne = True
    vehicle.set_mode(mode)


@pytest.mark.parametrize("sends_time", [False, True])
def test_rare_heartbeats_do_not_stop_the_orders(*, sends_time: bool) -> None:
    """It waits once for the clock of a vehicle that was away, and never for one without."""
    vehicle = Vehicle(1, Route(254, 190, 1, 1))
    for now in (0.0, 0.5) if sends_time else ():
        vehicle.take(mavlink.MAVLink_attitude_message(int(now * 1e3), 0, 0, 0, 0, 0, 0), now)
    (heartbeat,) = Decoder().decode(
        Encoder(1, 1).encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))
    )
    vehicle.take(heartbeat, 0.5)
    doubts = []
    for now in (6.0, 12.0, 18.0):
        vehicle.take(heartbeat, now)
        doubts.append(vehicle.may_be_restarted(now))
    assert doubts == [sends_time, False, False]


@pytest.mark.first_case
@FLOWN_ON
@pytest.mark.parametrize("away_s", [0.0, 3.0, 20.0])
def test_it_ends_an_abort(script: Script, mode: int, away_s: float) -> None:
    """Also where the link was away, so that the restart shows only when it is back."""
    world = going_to_a_point(script)
    vehicle = world.only_vehicle
    vehicle.silent = away_s > 0.0
    world.run(away_s)
    restart_in_the_air(world, mode)
    if not vehicle.silent:
        world.run_until(lambda: state(world) is State.IDLE, within_s=5.0)
    since = len(vehicle.frames)
    vehicle.silent = False
    world.run(15.0)
    assert orders(vehicle, since) == []
    assert state(world) is State.IDLE
    assert answer_statuses(world, 2) == ["accepted", "refused"]
    message = world.edge.acknowledgements(2)[-1]["message"]
    is_clear = mode == PX4_MISSION and away_s > 0.0  # Long after the abort: another has chosen it
    assert (
        "somebody else flies the vehicle" if is_clear else "the vehicle was restarted"
    ) in message


def test_it_ends_a_return_after_an_alarm_and_raises_one(tmp_path: Path) -> None:
    world = alarmed_world(tmp_path)
    restart_in_the_air(world, PX4_HOLD)
    world.only_vehicle.ill = 0
    world.run_until(lambda: state(world) is State.IDLE, within_s=5.0)
    world.air.is_uplink_up = True
    since = len(world.only_vehicle.frames)
    world.run(10.0)
    assert orders(world.only_vehicle, since) == []
    alarm = world.edge.bodies("/alarm/")[-1]
    assert (alarm["alarm_type_id"], alarm["alarm_code_id"]) == (2, 52)
    assert alarm["message"] == "mission error: the vehicle was restarted on its way home"


@pytest.mark.first_case
@pytest.mark.parametrize("kind", ["abort", "alarm"])
def test_it_ends_what_an_earlier_run_of_the_broker_has_ordered(kind: str, tmp_path: Path) -> None:
    """The restart shows by the time that was noted, and is reported."""
    if kind == "alarm":
        world = alarmed_world(tmp_path)
    else:
        world = world_at(1, journal=tmp_path)
        world.air.is_uplink_up = False
        world.edge.event(ABORT, abort=POINT)
    world.run(1.0)
    world.kill_broker()
    restart_in_the_air(world, PX4_HOLD)
    world.only_vehicle.ill = 0
    world.air.is_uplink_up = True
    since = len(world.only_vehicle.frames)
    world.run(2.0)
    world.restart_broker()
    world.run(15.0)
    assert orders(world.only_vehicle, since) == []
    if kind == "alarm":
        assert "restarted" in world.edge.bodies("/alarm/")[-1]["message"]
        assert world.edge.status(1201) == Status.FAILED
    else:
        assert answer_statuses(world, 2)[-1] == "refused"


def test_it_ends_what_a_restarted_broker_sees_through() -> None:
    world = going_to_a_point(PX4)
    world.kill_broker()
    world.restart_broker()
    world.run_until(lambda: state(world) is State.ABORTING, within_s=10.0)
    world.run(3.0)
    restart_in_the_air(world, PX4_HOLD)
    world.run_until(lambda: state(world) is State.IDLE, within_s=5.0)
    since = len(world.only_vehicle.frames)
    world.run(10.0)
    assert orders(world.only_vehicle, since) == []
    assert answer_statuses(world, 2) == ["accepted", "refused"]
    assert "restarted" in world.edge.acknowledgements(2)[-1]["message"]


@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def test_one_before_the_flight_that_shows_late_does_not_end_the_flight(
    script: Script, caplog: pytest.LogCaptureFixture
) -> None:
    """Its streams end with it, and with them the clock, until it is asked for them again."""
    world = World()
    vehicle = world.add_vehicle(script=replace(script, streams_unasked=False))
    world.run(60.0)
    vehicle.ignores_intervals = True
    vehicle.reboot(world.clock.now)
    world.run(5.0)
    world.edge.plan(first_flight())
    world.run_until(lambda: state(world) is State.RUNNING)
    assert "was restarted" not in caplog.text
    for _ in range(4):
        boot_ms = round((world.clock.now - vehicle.booted_at) * 1e3)
        world.send_from(vehicle, mavlink.MAVLink_attitude_message(boot_ms, *[0.0] * 6))
        world.run(0.5)
    assert "was restarted before it was armed" in caplog.text
    assert state(world) is State.RUNNING
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FINISHED


def require_end_on_the_ground(world: World) -> None:
    """Nobody arms or starts the vehicle again, and its mission has failed."""
    vehicle = world.only_vehicle
    since = len(vehicle.commands)
    world.run_until_over(1201, within_s=30.0)
    world.run(60.0)
    starting = {mavlink.MAV_CMD_MISSION_START, mavlink.MAV_CMD_COMPONENT_ARM_DISARM}
    assert not starting & set(vehicle.commands[since:])
    assert world.edge.status(1201) == Status.FAILED


@PX4_AND_ARDUPILOT
@pytest.mark.parametrize("away_s", [4.0, 45.0])
def test_one_during_the_takeoff_does_not_begin_the_mission_again(
    script: Script, away_s: float, tmp_path: Path
) -> None:
    """The link is lost, the vehicle restarts, the broker reports meanwhile, and is killed."""
    world = World(journal=tmp_path)
    vehicle = world.add_vehicle(script=replace(script, item_time_s=20.0))
    world.edge.plan(first_flight())
    world.run_until(lambda: state(world) is State.RUNNING)
    world.run(5.0)
    vehicle.silent = True
    world.run(1.0)
    vehicle.reboot(world.clock.now)
    world.run(away_s)
    assert world.edge.statuses(1201) == [Status.RUNNING, *[Status.NOT_STARTED] * 2]
    world.kill_broker()
    vehicle.silent = False
    world.restart_broker()
    require_end_on_the_ground(world)


@PX4_AND_ARDUPILOT
def test_one_that_no_report_precedes_shows_by_the_vehicles_clock(
    script: Script, tmp_path: Path
) -> None:
    """Edge server, broker and vehicle fail together, just after the order to start."""
    world = World(journal=tmp_path)
    vehicle = world.add_vehicle(script=replace(script, item_time_s=20.0))
    world.run(90.0)
    world.edge.plan(first_flight())
    world.run_until(lambda: vehicle.uploads > 0)
    world.edge.is_stalled = True
    world.run_until(lambda: vehicle.airborne)
    world.kill_broker()
    vehicle.reboot(world.clock.now)
    world.edge.is_stalled = False
    world.run(20.0)
    assert world.edge.status(1201) is None
    world.restart_broker()
    require_end_on_the_ground(world)
    assert "the vehicle was restarted" in world.edge.reports(1201)[-1]["message"]
