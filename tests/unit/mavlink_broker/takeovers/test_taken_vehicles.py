"""A vehicle that somebody else has: on the ground, without a position, in a hover."""

from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import OWN
from tests.support.broker_events import ABORT, POINT, SOFT_ABORT, answer_statuses
from tests.support.broker_world import (
    GENERIC,
    World,
    first_flight,
    go_home,
    land,
    mission,
    takeoff,
    waypoint,
)
from tests.support.mission_scenes import (
    REFUSING_RETURN,
    in_mission,
    refusing_to_return,
    slow,
    starting,
    state,
)
from tests.support.orders import ASKING, orders
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_GUIDED,
    COPTER_LAND,
    COPTER_RETURN,
    PX4,
    PX4_LAND,
    PX4_RETURN,
    Script,
)


class TestOnTheGround:
    """An abort disarms and stays: no place is flown to from there."""

    @pytest.mark.first_case
    @pytest.mark.parametrize("script", [PX4, OWN, ARDUPILOT, GENERIC])
    @pytest.mark.parametrize("kind", [ABORT, SOFT_ABORT])
    @pytest.mark.parametrize("more", [{}, {"abort": POINT}], ids=["here", "point"])
    def test_an_abort_disarms_and_stays(
        self, script: Script, kind: int, more: dict[str, Any]
    ) -> None:
        world = starting(script)
        vehicle = world.only_vehicle
        since = len(vehicle.frames)
        event = world.edge.event(kind, **more)
        world.run(10.0)
        assert not vehicle.armed
        assert not vehicle.airborne
        assert mavlink.MAV_CMD_DO_REPOSITION not in vehicle.commands
        assert orders(vehicle, since) != []
        assert world.edge.status(1201) == Status.ABORTED
        assert answer_statuses(world, event)[-1] == "done"

    @pytest.mark.first_case
    @pytest.mark.parametrize("script", [PX4, OWN, ARDUPILOT, GENERIC])
    @pytest.mark.parametrize("kind", [ABORT, SOFT_ABORT])
    @pytest.mark.parametrize("delay_s", [0.0, 0.5])
    def test_an_abort_disarms_one_whose_order_to_arm_may_still_arrive(
        self, script: Script, kind: int, delay_s: float
    ) -> None:
        """Its heartbeats, of one a second, still report that it is disarmed."""
        world = World()
        waits = {mavlink.MAV_CMD_MISSION_START: mavlink.MAV_RESULT_IN_PROGRESS}
        script = slow(script, heartbeats_at_once=False, results=waits)
        vehicle = world.add_vehicle(script=script)
        world.air.delay(vehicle, delay_s)
        world.edge.plan(first_flight())
        world.run_until(lambda: state(world) is State.ARMING)
        world.tick()
        event = world.edge.event(kind)
        world.run(20.0)
        assert mavlink.MAV_CMD_COMPONENT_ARM_DISARM in vehicle.commands
        assert not vehicle.armed
        assert not vehicle.airborne
        assert state(world) is State.IDLE
        assert world.edge.status(1201) == Status.ABORTED
        assert answer_statuses(world, event) == ["accepted", "done"]

    def test_a_refused_start_disarms_one_that_has_not_reported_its_arming(self) -> None:
        world = World()
        starts = mavlink.MAV_CMD_MISSION_START, mavlink.MAV_CMD_DO_SET_MODE
        denied = dict.fromkeys(starts, mavlink.MAV_RESULT_DENIED)
        script = slow(PX4, heartbeats_at_once=False, results=denied)
        vehicle = world.add_vehicle(script=script)
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        world.run(3.0)
        assert world.edge.status(1201) == Status.FAILED
        assert not vehicle.armed

    def test_one_that_has_left_the_ground_meanwhile_lands(self) -> None:
        """It refuses to disarm: its news of the ground were old."""
        world = starting(PX4)
        vehicle = world.only_vehicle
        denied = {mavlink.MAV_CMD_COMPONENT_ARM_DISARM: mavlink.MAV_RESULT_DENIED}
        vehicle.script = slow(PX4, results=denied)
        vehicle.airborne = True
        vehicle.stop_stream("landed")
        world.edge.event(ABORT, abort=POINT)
        world.run_until(lambda: vehicle.custom_mode == PX4_LAND, within_s=5.0)
        assert mavlink.MAV_CMD_DO_REPOSITION not in vehicle.commands


class TestWithoutAPosition:
    """It is ordered to land, and never to return or to go anywhere: it could find neither."""

    @pytest.mark.first_case
    @pytest.mark.parametrize(
        ("script", "landing"), [(PX4, PX4_LAND), (OWN, PX4_LAND), (ARDUPILOT, COPTER_LAND)]
    )
    @pytest.mark.parametrize("more", [None, {}, {"abort": POINT}], ids=["alarm", "soft", "point"])
    def test_it_lands(self, script: Script, landing: int, more: dict[str, Any] | None) -> None:
        world = in_mission(script)
        vehicle = world.only_vehicle
        since = len(vehicle.frames)
        vehicle.ill = mavlink.MAV_SYS_STATUS_SENSOR_GPS
        world.run(1.0)
        if more is not None:
            world.edge.event(SOFT_ABORT, **more)
        world.run_until(lambda: vehicle.custom_mode == landing, within_s=40.0)
        received = orders(vehicle, since)
        assert not any("192" in order.split("param1")[0] for order in received), received
        modes = [v[1:3] for c, v in vehicle.parameters if c == mavlink.MAV_CMD_DO_SET_MODE]
        assert (4.0, 5.0) not in modes
        assert (float(COPTER_RETURN), 0.0) not in modes
        assert vehicle.custom_mode not in {PX4_RETURN, COPTER_RETURN, COPTER_GUIDED}

    @pytest.mark.first_case
    @pytest.mark.parametrize(
        ("script", "landing"), [(PX4, PX4_LAND), (OWN, PX4_LAND), (ARDUPILOT, COPTER_LAND)]
    )
    @pytest.mark.parametrize("is_muted", [False, True], ids=["refused", "unanswered"])
    def test_no_return_is_ordered_again_once_it_is_known_to_be_lost(
        self, script: Script, landing: int, *, is_muted: bool
    ) -> None:
        world = refusing_to_return(script)
        vehicle = world.only_vehicle
        if is_muted:
            vehicle.lost_answers = set(REFUSING_RETURN)
        world.run(0.7)
        vehicle.ill = mavlink.MAV_SYS_STATUS_SENSOR_GPS
        snapshot = world.app.sessions[1].vehicle.snapshot
        world.run_until(lambda: snapshot.lacks_position, within_s=5.0)
        since = len(vehicle.parameters)
        world.run(2.0)
        vehicle.script = slow(script)
        world.run(4.0)
        received = [(c, *v[1:3]) for c, v in vehicle.parameters[since:] if c not in ASKING]
        px4_return, copter_return = (4.0, 5.0), (float(COPTER_RETURN), 0.0)
        assert not [one for one in received if one[1:] in {px4_return, copter_return}]
        assert mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH not in {one[0] for one in received}
        assert vehicle.custom_mode == landing


class TestAHoverIsEnded:
    """By a plan of its own: a landing or a return needs no take-off before."""

    @pytest.mark.first_case
    @pytest.mark.parametrize("script", [PX4, OWN, ARDUPILOT, GENERIC])
    @pytest.mark.parametrize("last", [land(1), go_home(1)], ids=["land", "home"])
    def test_by_a_landing_or_a_return(self, script: Script, last: dict[str, Any]) -> None:
        world = World()
        vehicle = world.add_vehicle(script=script)
        world.edge.plan(mission(takeoff(1), waypoint(2)))
        world.run_until_over(1201)
        world.run(2.0)
        assert vehicle.airborne
        world.edge.plan(mission(last, mission_id=1202))
        world.run_until_over(1202)
        assert world.edge.statuses(1202) == [Status.FINISHED]
        assert not vehicle.airborne

    @pytest.mark.parametrize("last", [land(1), go_home(1)], ids=["land", "home"])
    def test_and_nothing_is_done_on_the_ground(self, last: dict[str, Any]) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.edge.plan(mission(last))
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FAILED
        assert "a take-off has to come first" in world.edge.reports(1201)[-1]["message"]
        assert vehicle.uploads == 0
