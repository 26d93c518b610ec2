"""An error in one vehicle's session affects that vehicle's mission only."""

import logging
import math
import struct
from collections.abc import Callable
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.abort_executor import AbortExecutor
from mavlink_broker.mission.mission_queue import MissionQueue
from mavlink_broker.mission.states import State
from mavlink_broker.routing.router import Router
from mavlink_broker.session import Session
from tests.support.broker_events import ABORT, POINT, SOFT_ABORT, answer_statuses
from tests.support.broker_world import FINISHED, World, first_flight
from tests.support.fenced_vehicle import ARDUPILOT_VALUES, PX4_VALUES, FencedVehicle
from tests.support.mission_reports import message_of
from tests.support.mission_scenes import world_at
from tests.support.vehicle_script import ARDUPILOT, HOME, PX4, PX4_RETURN, Script

HALF = 40 * 9e-6
FENCE = {
    "inclusion": [
        [
            [HOME[0] - HALF, HOME[1] - HALF * 1.3],
            [HOME[0] - HALF, HOME[1] + HALF * 1.3],
            [HOME[0] + HALF, HOME[1] + HALF * 1.3],
            [HOME[0] + HALF, HOME[1] - HALF * 1.3],
        ]
    ],
    "max_altitude": 30.0,
}


def fenced(world: World, system: int, script: Script, values: dict[str, float]) -> FencedVehicle:
    vehicle = FencedVehicle(system, script, booted_at=world.clock.now, values=values)
    world.air.vehicles["192.0.2.1", 14580 + system] = vehicle
    return vehicle


def plan_for(world: World, *systems: int, geofence: dict[str, Any] | None = None) -> None:
    for system in systems:
        world.edge.plan(first_flight(mission_id=system, vehicle_id=system), geofence=geofence)


class TestParametersThatAreNoNumbers:
    @pytest.mark.first_case
    @pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
    @pytest.mark.parametrize(
        ("script", "name", "others"),
        [
            *((ARDUPILOT, name, ARDUPILOT_VALUES) for name in ARDUPILOT_VALUES if "FEN" in name),
            (PX4, "GF_MAX_VER_DIST", PX4_VALUES),
            (PX4, "RTL_RETURN_ALT", PX4_VALUES),
        ],
    )
    def test_fail_their_mission_by_name_and_leave_the_other_vehicle_flying(
        self, script: Script, name: str, others: dict[str, float], value: float
    ) -> None:
        world = World()
        fenced(world, 1, script, others | {name: value})
        fenced(world, 2, script, dict(others))
        plan_for(world, 1, 2, geofence=FENCE)
        world.run_until_over(2)
        assert world.edge.statuses(2) == FINISHED
        assert world.edge.status(1) == Status.FAILED
        assert name in message_of(world, 1)
        assert not world.app.internal_errors.count

    def test_are_never_overridden(self) -> None:
        world = World()
        vehicle = fenced(world, 1, ARDUPILOT, ARDUPILOT_VALUES | {"FENCE_ALT_MAX": math.nan})
        plan_for(world, 1, geofence=FENCE)
        world.run_until_over(1)
        assert vehicle.set == []


def breaking(owner: type, name: str, when: Callable[[Any], bool]) -> pytest.MonkeyPatch:
    """Let a method raise for some of its objects."""
    patch = pytest.MonkeyPatch()
    genuine = getattr(owner, name)

    def method(self: Any, *args: Any, **named: Any) -> Any:
        if when(self):
            raise ValueError("cannot convert float NaN to integer")
        return genuine(self, *args, **named)

    patch.setattr(owner, name, method)
    return patch


def is_first(one: Session | MissionQueue) -> bool:
    return one.vehicle.vehicle_id == 1


class TestUnexpectedErrors:
    @pytest.mark.first_case
    @pytest.mark.parametrize(
        ("owner", "entry"),
        [
            (Session, "receive"),
            (Session, "step"),
            (MissionQueue, "take_mission"),
            (MissionQueue, "take_acceptance_result"),
        ],
    )
    def test_of_one_vehicle_leave_the_others_flying(self, owner: type, entry: str) -> None:
        world = World()
        world.add_vehicle(1)
        world.add_vehicle(2)
        world.run(3.0)
        plan_for(world, 1, 2)
        patch = breaking(owner, entry, is_first)
        try:
            world.run_until_over(2)
        finally:
            patch.undo()
        assert world.edge.statuses(2) == FINISHED
        assert world.app.internal_errors.count > 0

    @pytest.mark.first_case
    @pytest.mark.parametrize("phase_s", [0.0, 0.1, 0.5, 1.0, 2.0, 4.0, 6.0])
    @pytest.mark.parametrize("entry", ["receive", "step"])
    def test_fail_the_mission_once_with_the_reason_at_whatever_time(
        self, phase_s: float, entry: str, caplog: pytest.LogCaptureFixture
    ) -> None:
        world = World()
        vehicle = world.add_vehicle(1)
        world.run(3.0)
        plan_for(world, 1)
        world.run(phase_s)
        raised: list[int] = []

        def once(session: Session) -> bool:
            flies = session.state.name != "IDLE"
            if flies and not raised:
                raised.append(1)
                return True
            return False

        patch = breaking(Session, entry, once)
        with caplog.at_level(logging.ERROR):
            world.run_until_over(1)
        patch.undo()
        reports = world.edge.reports(1)
        ended = [r for r in reports if r["mission_status_id"] >= Status.FINISHED]
        assert [r["mission_status_id"] for r in ended] == [Status.FAILED]
        assert "cannot convert float NaN to integer" in message_of(world, 1)
        assert world.app.internal_errors.count == 1
        assert "Traceback" in caplog.text
        world.run(1.0)
        assert "NaN" in world.edge.bodies("/vehicles/1")[-1]["warning"]
        world.run_until(lambda: not vehicle.armed, within_s=60.0)
        world.edge.plan(first_flight(mission_id=9, vehicle_id=1))
        world.run_until_over(9)
        assert world.edge.statuses(9) == FINISHED

    def test_in_flight_bring_the_vehicle_home_unless_another_client_flies_it(self) -> None:
        world = World()
        vehicle = world.add_vehicle(1)
        plan_for(world, 1)
        world.run_until(lambda: vehicle.airborne)
        world.run(1.0)
        patch = breaking(Session, "step", lambda session: session.state.name == "RUNNING")
        world.run(2.0)
        patch.undo()
        assert vehicle.custom_mode == PX4_RETURN
        assert world.edge.status(1) == Status.FAILED

    def test_that_never_end_are_counted_but_not_logged_without_end(
        self, caplog: pytest.LogCaptureFixture
    ) -> None:
        world = World(tick_s=0.1)
        world.add_vehicle(1)
        world.run(1.0)
        patch = breaking(Session, "step", is_first)
        with caplog.at_level(logging.ERROR):
            world.run(20.0)
        patch.undo()
        assert world.app.internal_errors.count > 100
        assert len([r for r in caplog.records if r.exc_info]) <= 2

    def test_a_mission_whose_end_raises_too_is_dropped(self) -> None:
        world = World()
        world.add_vehicle(1)
        plan_for(world, 1)
        world.run(4.0)
        patches = [
            breaking(Session, "step", is_first),
            breaking(MissionQueue, "fail_after_error", is_first),
        ]
        world.run(1.0)
        for patch in patches:
            patch.undo()
        assert world.edge.status(1) == Status.FAILED
        assert world.app.sessions[1].state.name == "IDLE"

    def test_a_message_that_does_not_fit_the_wire_costs_its_mission_alone(self) -> None:
        world = World()
        world.add_vehicle(1)
        world.add_vehicle(2)
        plan_for(world, 1, 2)
        world.run(4.0)
        genuine = Session.step
        patch = pytest.MonkeyPatch()

        def step(session: Session, now: float, effects: Any) -> None:
            genuine(session, now, effects)
            if is_first(session) and session.state.name != "IDLE":
                effects.messages.append(mavlink.MAVLink_heartbeat_message(999, 8, 0, 0, 4, 3))

        patch.setattr(Session, "step", step)
        world.run_until_over(2)
        patch.undo()
        assert world.edge.statuses(2) == FINISHED
        assert world.edge.status(1) == Status.FAILED

    def test_a_datagram_that_raises_costs_itself(self) -> None:
        world = World()
        world.add_vehicle(1)
        world.add_vehicle(2)
        patch = pytest.MonkeyPatch()
        genuine = Router._receive_vehicles

        def take(self: Router, address: Any, data: bytes, now: float) -> Any:
            if address.port == 14581:
                raise struct.error("bad")
            return genuine(self, address, data, now)

        patch.setattr(Router, "_receive_vehicles", take)
        plan_for(world, 2)
        world.run_until_over(2)
        patch.undo()
        assert world.edge.statuses(2) == FINISHED
        assert world.app.internal_errors.count > 0

    def test_an_abort_that_raises_is_refused_and_the_mission_fails(self) -> None:
        world = World()
        world.add_vehicle(1)
        plan_for(world, 1)
        world.run(6.0)
        patch = breaking(MissionQueue, "take_event", is_first)
        work = world.edge.event(1)
        world.run(2.0)
        patch.undo()
        assert world.edge.acknowledgements(work)[-1]["status"] == "refused"
        assert world.edge.status(1) == Status.FAILED

    def test_an_abort_whose_interruption_raises_is_refused_once(self) -> None:
        world = world_at(1)
        patch = breaking(MissionQueue, "_abort", is_first)
        work = world.edge.event(ABORT)
        world.run(2.0)
        patch.undo()
        assert answer_statuses(world, work) == ["refused"]

    @pytest.mark.first_case
    @pytest.mark.parametrize("also", [(), ("fail_after_error",)], ids=["failed", "dropped"])
    def test_a_deferred_abort_that_raises_is_refused_once_with_the_reason(
        self, also: tuple[str, ...]
    ) -> None:
        world = world_at(1)
        world.kill_broker()
        work = world.edge.event(SOFT_ABORT)
        patches = [breaking(MissionQueue, name, is_first) for name in ("_abort", *also)]
        world.restart_broker()
        world.run(3.0)
        for patch in patches:
            patch.undo()
        assert answer_statuses(world, work) == ["refused"]
        assert "NaN" in world.edge.acknowledgements(work)[-1]["message"]

    def test_a_deferred_abort_is_refused_when_the_step_before_it_raises(self) -> None:
        world = world_at(1)
        world.kill_broker()
        work = world.edge.event(SOFT_ABORT)
        patches = [
            breaking(MissionQueue, "_carry_out_events", lambda one: one.vehicle.snapshot.armed),
            breaking(MissionQueue, "fail_after_error", is_first),
        ]
        world.restart_broker()
        world.run(3.0)
        for patch in patches:
            patch.undo()
        assert answer_statuses(world, work) == ["refused"]

    @pytest.mark.first_case
    @pytest.mark.parametrize("also", [(), ("fail_after_error",)], ids=["failed", "dropped"])
    def test_an_accepted_abort_is_not_done_when_the_flight_to_its_point_raises(
        self, also: tuple[str, ...]
    ) -> None:
        world = world_at(1)
        world.only_vehicle.height_m = 40.0
        work = world.edge.event(ABORT, abort=POINT)
        world.run_until(lambda: world.app.sessions[1].state is State.ABORTING)
        patches = [breaking(MissionQueue, name, is_first) for name in also]
        patches.append(breaking(AbortExecutor, "tick", lambda _: True))
        world.run(5.0)
        for patch in patches:
            patch.undo()
        assert answer_statuses(world, work) == ["accepted", "refused"]
        assert "NaN" in world.edge.acknowledgements(work)[-1]["message"]

    def test_an_abort_whose_return_raises_each_time_is_refused_and_ends(self) -> None:
        world = world_at(1)
        world.only_vehicle.height_m = 40.0
        work = world.edge.event(ABORT, abort=POINT)
        world.run_until(lambda: world.app.sessions[1].state is State.ABORTING)
        world.tick()
        world.kill_broker()
        world.restart_broker()
        patch = breaking(AbortExecutor, "tick", lambda _: True)
        world.run(5.0)
        patch.undo()
        assert answer_statuses(world, work)[-1] == "refused"
        assert world.app.internal_errors.count == 1
        assert world.app.sessions[1].state is State.IDLE
