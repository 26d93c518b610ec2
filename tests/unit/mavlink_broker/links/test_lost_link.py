"""A link that is lost at the worst moment: when the vehicle has to answer."""

import dataclasses

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import OWN
from tests.support.broker_world import World, go_home, hotpoint, mission, takeoff, waypoint
from tests.support.mission_reports import command_messages
from tests.support.real_autopilots import COPTER_4_6, PX4_1_17
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import ARDUPILOT, PX4_RETURN, Script

AWAY_S = 15.0
"""Longer than any order is repeated, and than a link takes to count as lost."""
COMMANDS = (takeoff(1), hotpoint(2, start_point=4), waypoint(3), go_home(4))
IN_FLIGHT = {
    "holding": State.HOLDING,
    "uploading": State.UPLOADING,
    "verifying": State.VERIFYING,
    "selecting": State.SELECTING,
    "arming": State.ARMING,
    "starting": State.STARTING,
}


def world_of(script: Script, delay_s: float | None = None) -> World:
    """A world with a mission of a circle between two segments."""
    world = World(tick_s=0.02)  # Some states last for a step only
    vehicle = world.add_vehicle(script=dataclasses.replace(script, item_time_s=1.0))
    if delay_s is not None:
        world.air.delay(vehicle, delay_s)
    world.run(2.0)
    world.edge.plan(mission(*COMMANDS))
    return world


def run_until_in(world: World, state: State) -> None:
    world.run_until(lambda: world.app.sessions[1].state is state)


def lose_link(world: World, seconds: float = AWAY_S) -> ScriptedVehicle:
    vehicle = world.only_vehicle
    vehicle.silent = True
    world.run(seconds)
    vehicle.armed &= vehicle.airborne  # A vehicle that is not started disarms by itself
    vehicle.silent = False
    return vehicle


def unheard_behind_the_circle() -> tuple[World, ScriptedVehicle]:
    """A world whose vehicle has gone silent during the upload of its second segment."""
    world = world_of(PX4_1_17)
    run_until_in(world, State.FLYING_LIVE)
    run_until_in(world, State.UPLOADING)
    world.only_vehicle.silent = True
    world.run(AWAY_S)
    return world, world.only_vehicle


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("script", "delay_s"), [(OWN, None), (PX4_1_17, 0.2)], ids=["delivered", "lost"]
)
@pytest.mark.parametrize("state", IN_FLIGHT.values(), ids=IN_FLIGHT)
def test_between_two_stages_it_is_waited_for(
    script: Script, state: State, delay_s: float | None
) -> None:
    world = world_of(script, delay_s)
    run_until_in(world, State.FLYING_LIVE)
    run_until_in(world, state)
    vehicle = lose_link(world)
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.FINISHED] * 4
    assert vehicle.commands.count(mavlink.MAV_CMD_DO_ORBIT) == 1


@pytest.mark.first_case
@pytest.mark.parametrize("delay_s", [None, 0.2], ids=["delivered", "lost"])
@pytest.mark.parametrize("script", [OWN, PX4_1_17], ids=["own", "PX4"])
def test_an_order_for_a_circle_is_repeated_only_if_it_did_not_arrive(
    script: Script, delay_s: float | None
) -> None:
    world = world_of(script, delay_s)
    run_until_in(world, State.FLYING_LIVE)
    vehicle = lose_link(world, 10.0)
    orders = vehicle.commands.count(mavlink.MAV_CMD_DO_ORBIT)
    assert orders == (1 if delay_s is None else 0)
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.FINISHED] * 4
    assert vehicle.commands.count(mavlink.MAV_CMD_DO_ORBIT) == 1


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("script", "delay_s", "state"),
    [
        (OWN, 0.2, State.UPLOADING),
        (COPTER_4_6, 0.2, State.ARMING),
        (PX4_1_17, None, State.STARTING),
        (PX4_1_17, None, State.ARMING),
        (PX4_1_17, 0.2, State.STARTING),
    ],
)
def test_before_the_take_off_it_is_waited_for_too(
    script: Script, delay_s: float | None, state: State
) -> None:
    world = world_of(script, delay_s)
    run_until_in(world, state)
    lose_link(world)
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.FINISHED] * 4


def test_a_mission_that_was_flown_meanwhile_is_finished_and_not_flown_again() -> None:
    world = World()
    vehicle = world.add_vehicle()
    world.run(2.0)
    world.edge.plan(mission(takeoff(1), go_home(2)))
    run_until_in(world, State.STARTING)
    lose_link(world, 40.0)
    assert not vehicle.armed
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.FINISHED] * 2
    world.run(60.0)
    assert not vehicle.armed
    assert vehicle.uploads == 1


def test_a_vehicle_that_its_failsafe_returns_meanwhile_gets_no_order() -> None:
    world, vehicle = unheard_behind_the_circle()
    vehicle.fail_safe(PX4_RETURN)
    vehicle.silent = False
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FAILED
    assert command_messages(world)[2] == (
        "the vehicle left the mission: mode AUTO.RTL: its own failsafe flies it"
    )
    assert vehicle.custom_mode == PX4_RETURN


def test_a_vehicle_that_was_restarted_meanwhile_has_failed() -> None:
    world, vehicle = unheard_behind_the_circle()
    vehicle.reboot(world.clock.now)
    vehicle.silent = False
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FAILED
    world.run(60.0)
    assert not vehicle.armed


def test_a_refusal_is_one_also_after_the_link_was_away() -> None:
    denied = {mavlink.MAV_CMD_DO_ORBIT: mavlink.MAV_RESULT_DENIED}
    world = world_of(dataclasses.replace(OWN, results=denied), 0.2)
    run_until_in(world, State.FLYING_LIVE)
    lose_link(world)
    world.run_until_over(1201)
    assert world.edge.statuses(1201)[1] == Status.FAILED


class TestALinkOfOneDirection:
    """Telemetry arrives, and no order does."""

    @pytest.mark.first_case
    @pytest.mark.parametrize("script", [OWN, PX4_1_17, COPTER_4_6], ids=["own", "px4", "copter"])
    def test_is_shown_until_the_vehicle_answers_again(
        self, script: Script, caplog: pytest.LogCaptureFixture
    ) -> None:
        caplog.set_level("INFO")
        world = World()
        world.add_vehicle(script=script)
        world.run(20.0)
        assert warning(world) is None
        world.air.is_uplink_up = False
        world.run(20.0)
        assert "does not answer" in (warning(world) or "")
        assert caplog.text.count("does not answer") == 1
        world.air.is_uplink_up = True
        world.run(5.0)
        assert warning(world) is None
        assert caplog.text.count("it answers again") == 1

    def test_is_shown_if_it_never_answered(self) -> None:
        world = World()
        world.air.is_uplink_up = False
        world.add_vehicle(script=PX4_1_17)
        world.run(20.0)
        assert "does not answer" in (warning(world) or "")

    def test_is_not_taken_from_a_vehicle_without_timesync(self) -> None:
        world = World()
        world.add_vehicle(script=dataclasses.replace(PX4_1_17, has_timesync=False))
        world.run(60.0)
        assert warning(world) is None

    @pytest.mark.first_case
    @pytest.mark.parametrize("loss", [0.1, 0.3])
    def test_is_not_taken_from_one_that_loses_frames(
        self, loss: float, caplog: pytest.LogCaptureFixture
    ) -> None:
        world = World(loss=loss)
        world.add_vehicle(script=PX4_1_17)
        world.run(300.0)
        assert "does not answer" not in caplog.text


def test_a_lost_link_and_its_return_are_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    world = World()
    world.add_vehicle(script=PX4_1_17)
    world.run(5.0)
    assert "link" not in caplog.text.replace("mavlink", "")
    lose_link(world, 20.0)
    world.run(3.0)
    texts = [text for text in caplog.messages if "its link is" in text]
    assert [text.split(", ")[0].split(" after ")[0] for text in texts] == [
        "vehicle 1: its link is lost",
        "vehicle 1: its link is back",
    ]


def warning(world: World) -> str | None:
    """The newest warning that the edge server has of the vehicle."""
    text: str | None = world.edge.bodies("/vehicles/1")[-1]["warning"]
    return text


@pytest.mark.first_case
@pytest.mark.parametrize("away_s", [8.0, 14.0])
def test_a_vehicle_that_has_disarmed_before_its_take_off_has_flown_nothing(away_s: float) -> None:
    """ArduPilot, disarmed in its mission mode, shows the same as behind a landing at home."""
    world = World(tick_s=0.02)
    vehicle = world.add_vehicle(script=dataclasses.replace(ARDUPILOT, ignores_start=True))
    world.run(2.0)
    far = waypoint(2, north_m=200.0)
    world.edge.plan(mission(takeoff(1), far, waypoint(3, north_m=-200.0), go_home(4)))
    world.run_until(lambda: mavlink.MAV_CMD_MISSION_START in vehicle.commands)
    vehicle.silent = True
    vehicle.set_mode(ARDUPILOT.mission_mode)
    vehicle.armed = False
    world.run(away_s)
    vehicle.silent = False
    world.run(40.0)
    assert Status.FINISHED not in world.edge.statuses(1201)
