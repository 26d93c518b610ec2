"""A plan's geofence: onto the vehicle before it may fly, off it again after the mission."""

import math
from dataclasses import replace
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import PX4_AND_ARDUPILOT
from tests.support.broker_world import (
    FINISHED,
    World,
    first_flight,
    go_home,
    mission,
    takeoff,
    waypoint,
)
from tests.support.fenced_vehicle import (
    ARDUPILOT_VALUES,
    FENCE,
    PX4_VALUES,
    RALLY,
    FencedVehicle,
    fenced_vehicle,
)
from tests.support.geofences import EXCLUSION, INCLUSION, RALLY_POINT, fence, fly, placed, square
from tests.support.mission_reports import message_of
from tests.support.vehicle_script import ARDUPILOT, HOME, PX4, Script

FOR_A_STATION = mavlink.MAVLink_command_ack_message(
    mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_RESULT_ACCEPTED, target_system=255
)


class TestPlacing:
    @pytest.mark.first_case
    @PX4_AND_ARDUPILOT
    def test_the_fence_is_stored_before_the_mission_and_the_mission_before_the_arming(
        self, script: Script
    ) -> None:
        world = World()
        vehicle = fenced_vehicle(world, script)
        fly(world, fence(exclusion=[square(200.0)]))
        assert world.edge.statuses(1201) == FINISHED
        order = [
            entry for entry in vehicle.log if entry in {"stored 1", "stored 0", "ordered to arm"}
        ]
        assert order[:3] == ["stored 1", "stored 0", "ordered to arm"]

    def test_its_corners_are_those_of_the_plan_each_with_their_number(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        world.edge.plan(first_flight(), geofence=fence(exclusion=[square(200.0)[:3]]))
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        corners = [*square(), *square(200.0)[:3]]
        assert [place[1:] for place in vehicle.fence] == [
            pytest.approx(corner, abs=1e-7) for corner in corners
        ]
        commands = [(item.command, item.param1) for item in vehicle.plans[FENCE].items]
        assert commands == [(INCLUSION, 4.0)] * 4 + [(EXCLUSION, 3.0)] * 3

    @PX4_AND_ARDUPILOT
    @pytest.mark.parametrize("seed", range(2))
    def test_a_fifth_lost_in_each_direction_changes_nothing(
        self, script: Script, seed: int
    ) -> None:
        world = World(loss=0.2, seed=seed)
        vehicle = fenced_vehicle(world, script)
        world.edge.plan(first_flight(), geofence=fence(max_altitude=60.0))
        world.run_until(lambda: (world.edge.status(1201) or 0) >= Status.RUNNING, within_s=200.0)
        assert world.edge.status(1201) == Status.RUNNING
        assert len(vehicle.fence) == 4

    def test_a_vehicle_that_sends_the_items_of_a_fence_as_a_mission_s_keeps_it(self) -> None:
        """PX4 up to 1.14.0, which gives no ids either, so that they are read back."""
        world = World()
        old = replace(PX4, gives_ids=False)
        vehicle = fenced_vehicle(world, old, types_items=False)
        placed(vehicle, square(half_m=60.0))
        world.edge.plan(first_flight(), geofence=fence(), rally_points=[RALLY_POINT])
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        assert len(vehicle.fence) == 4
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        world.run(20.0)
        corners = [place[1:] for place in vehicle.fence]
        assert corners == [pytest.approx(corner, abs=1e-7) for corner in square(half_m=60.0)]

    @pytest.mark.thorough
    def test_a_plan_of_two_segments_places_it_once(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        hotpoint = {
            "command_id": 2,
            "command_type_id": 7,
            "parameters": {
                "latitude": HOME[0],
                "longitude": HOME[1],
                "orbit_altitude": 10,
                "radius": 10,
            },
        }
        world.edge.plan(mission(takeoff(), hotpoint, waypoint(3), go_home(4)), geofence=fence())
        world.run_until_over(1201)
        assert vehicle.log.count("stored 0") == 2
        assert vehicle.log.count("stored 1") == 1

    @pytest.mark.first_case
    @PX4_AND_ARDUPILOT
    @pytest.mark.parametrize("away_s", [3.0, 15.0, 40.0])
    def test_one_that_receives_nothing_at_first_gets_it_before_it_flies(
        self, script: Script, away_s: float
    ) -> None:
        """A link of one direction: nobody knows yet whether the vehicle keeps a geofence."""
        world = World()
        vehicle = fenced_vehicle(world, script)
        world.air.is_uplink_up = False
        world.edge.plan(first_flight(), geofence=fence())
        for _ in range(round(away_s)):
            world.run(1.0)
            vehicle.send(FOR_A_STATION)
        world.air.is_uplink_up = True
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        assert len(vehicle.fence) == 4
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    def test_a_vehicle_that_cannot_keep_one_flies_checked_by_the_broker_alone(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world, capabilities=0)
        fly(world, fence(max_altitude=60.0))
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.fence == []
        assert vehicle.set == []
        assert "keeps no geofence: the broker alone has checked" in message_of(world)

    def test_a_fence_that_the_vehicle_refuses_fails_the_mission_before_take_off(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        vehicle.plans[FENCE].script = replace(PX4, refused_item=2)
        fly(world, fence())
        assert world.edge.status(1201) == Status.FAILED
        assert "geofence refused: MAV_MISSION_INVALID_PARAM3 at item 2" in message_of(world)
        assert "ordered to arm" not in vehicle.log
        assert "stored 0" not in vehicle.log

    def test_a_fence_that_comes_back_otherwise_fails_the_mission_before_take_off(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world, replace(ARDUPILOT, gives_ids=False))
        vehicle.plans[FENCE].script = replace(
            ARDUPILOT, home_is_item_0=False, keeps=_moved_by_a_metre
        )
        fly(world, fence())
        assert world.edge.status(1201) == Status.FAILED
        assert "geofence: item 0 on the vehicle differs in latitude" in message_of(world)
        assert "ordered to arm" not in vehicle.log

    def test_one_that_its_vehicle_stores_otherwise_makes_room_for_the_operators(self) -> None:
        """It is the plan's, changed by the vehicle, and nobody else's."""
        world = World()
        vehicle = fenced_vehicle(world, replace(ARDUPILOT, gives_ids=False))
        placed(vehicle, square(half_m=90.0))
        operators = vehicle.fence
        store = vehicle.plans[FENCE]
        store.script = replace(ARDUPILOT, home_is_item_0=False, keeps=_moved_by_a_metre)
        fly(world, fence())
        assert world.edge.status(1201) == Status.FAILED
        store.script = replace(ARDUPILOT, home_is_item_0=False)
        world.run(60.0)
        assert vehicle.fence == operators

    def test_one_that_the_vehicle_does_not_take_back_is_a_warning_until_it_does(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        placed(vehicle, square(half_m=90.0))
        operators, store = vehicle.fence, vehicle.plans[FENCE]
        world.edge.plan(first_flight(), geofence=fence())
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        store.script = replace(PX4, refused_item=2)
        world.run_until_over(1201)
        world.run(20.0)
        warning = world.edge.bodies("/vehicles/1")[-1]["warning"]
        assert warning == (
            "it keeps the geofence and limits of its last plan: "
            "geofence refused: MAV_MISSION_INVALID_PARAM3 at item 2"
        )
        store.script = PX4
        world.run(40.0)
        assert vehicle.fence == operators
        assert world.edge.bodies("/vehicles/1")[-1]["warning"] is None

    def test_without_a_geofence_nothing_is_requested_of_the_vehicle(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        fly(world, None)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.log[0] == "stored 0"
        assert vehicle.set == []


def _moved_by_a_metre(item: Any) -> Any:
    item.x += 100
    return item


def put_behind_refusal(world: World, vehicle: FencedVehicle) -> list[tuple[int, float, float]]:
    """Let an operator's fence arrive on a busy vehicle that has just refused that of the broker."""
    store = vehicle.plans[FENCE]
    world.run_until(lambda: store.busy_answers, within_s=900.0)
    world.run(1.0)
    placed(vehicle, square(half_m=70.0))
    store.busy_until = 0.0
    return vehicle.fence


class TestInterruptions:
    """Before the mission, with half of the fence uploaded."""

    def halfway(self) -> tuple[World, FencedVehicle]:
        world = World()
        vehicle = fenced_vehicle(world)
        vehicle.plans[FENCE].script = replace(PX4, lost_acknowledgements=10**6)
        vehicle.plans[FENCE].busy_until = world.clock.now + 60.0
        world.run_until(lambda: 1 in world.app.sessions)
        world.edge.plan(first_flight(), geofence=fence())
        world.run_until(lambda: world.app.sessions[1].state is State.PLACING_GEOFENCE)
        world.run(2.0)
        return world, vehicle

    def test_an_abort_ends_the_mission_on_the_ground(self) -> None:
        world, vehicle = self.halfway()
        event = world.edge.event(1)
        world.run(2.0)
        assert world.edge.status(1201) == Status.ABORTED
        assert world.edge.acknowledgements(event)[-1]["status"] == "done"
        assert "ordered to arm" not in vehicle.log

    def test_a_vehicle_that_restarts_is_begun_with_again(self) -> None:
        world, vehicle = self.halfway()
        vehicle.reboot(world.clock.now)
        vehicle.plans[FENCE].drop_transfer()
        vehicle.plans[FENCE].busy_until = 0.0
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.log.count("stored 1") == 1

    @pytest.mark.thorough
    def test_a_vehicle_that_vanishes_fails_the_mission_in_the_end(self) -> None:
        world, vehicle = self.halfway()
        vehicle.silent = True
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FAILED


class TestRestoring:
    @pytest.mark.first_case
    @PX4_AND_ARDUPILOT
    def test_a_vehicle_without_a_fence_has_none_afterwards(self, script: Script) -> None:
        world = World()
        vehicle = fenced_vehicle(world, script)
        fly(world, fence(max_altitude=60.0))
        world.run(20.0)
        assert vehicle.fence == []
        assert vehicle.values == (PX4_VALUES if script is PX4 else ARDUPILOT_VALUES)

    @pytest.mark.first_case
    @PX4_AND_ARDUPILOT
    def test_an_operators_fence_comes_back(self, script: Script) -> None:
        world = World()
        vehicle = fenced_vehicle(world, script)
        placed(vehicle, square(half_m=90.0))
        operators = vehicle.fence
        world.edge.plan(first_flight(), geofence=fence())
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        assert vehicle.fence != operators
        assert "gets its own geofence back" in message_of(world)
        world.run_until_over(1201)
        world.run(20.0)
        assert vehicle.fence == operators

    def test_a_plan_without_one_leaves_an_operators_fence_alone(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        placed(vehicle, square(half_m=90.0))
        operators = vehicle.fence
        fly(world, None)
        world.run(20.0)
        assert vehicle.fence == operators

    @pytest.mark.first_case
    @PX4_AND_ARDUPILOT
    @pytest.mark.parametrize("seed", range(3))
    def test_nothing_is_kept_over_a_link_that_loses_a_fifth_in_each_direction(
        self, script: Script, seed: int
    ) -> None:
        world = World(loss=0.2, seed=seed)
        vehicle = fenced_vehicle(world, script)
        low = mission(takeoff(), go_home(2))
        world.edge.plan(low, geofence=fence(max_altitude=60.0), rally_points=[RALLY_POINT])
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FINISHED
        world.run_until(lambda: not world.app.sessions[1].vehicle.overrides.is_open)
        assert vehicle.fence == vehicle.plans[RALLY].items == []
        assert vehicle.values == (PX4_VALUES if script is PX4 else ARDUPILOT_VALUES)

    def test_a_geofence_that_forbids_nothing_changes_nothing(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world, ARDUPILOT)
        fly(world, {"inclusion": [], "exclusion": []})
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.set == []

    def test_a_value_that_somebody_set_meanwhile_stays(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        world.edge.plan(first_flight(), geofence={"max_altitude": 40.0})
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        vehicle.values["GF_MAX_VER_DIST"] = 25.0
        world.run_until_over(1201)
        world.run(20.0)
        assert vehicle.values == PX4_VALUES | {"GF_MAX_VER_DIST": 25.0}

    def test_the_next_plan_does_not_fly_under_the_fence_of_the_one_before(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        world.edge.plan(first_flight(), geofence=fence())
        world.edge.plan(first_flight(1202))
        world.run_until_over(1202)
        stored, removed = vehicle.log.index("stored 1"), vehicle.log.index("cleared 1")
        missions = [i for i, entry in enumerate(vehicle.log) if entry == "stored 0"]
        assert stored < missions[0] < removed < missions[1]

    def test_the_next_plans_fence_takes_its_place_and_the_operators_still_comes_back(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        placed(vehicle, square(half_m=90.0))
        operators = vehicle.fence
        world.edge.plan(first_flight(), geofence=fence())
        world.edge.plan(first_flight(1202), geofence={"inclusion": [square(half_m=50.0)]})
        world.run_until(lambda: world.edge.status(1202) == Status.RUNNING, within_s=300.0)
        assert vehicle.fence[0][1] == pytest.approx(square(half_m=50.0)[0][0], abs=1e-7)
        world.run_until_over(1202)
        world.run(20.0)
        assert vehicle.fence == operators

    def test_a_fence_that_somebody_put_there_meanwhile_stays(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        world.edge.plan(first_flight(), geofence=fence())
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        placed(vehicle, square(half_m=70.0))
        theirs = vehicle.fence
        world.run_until_over(1201)
        world.run(20.0)
        assert vehicle.fence == theirs

    @pytest.mark.parametrize("operators", [square(half_m=90.0), []], ids=["fenced", "without"])
    def test_so_does_one_that_is_being_put_there_when_the_own_one_comes_back(
        self, operators: list[list[float]]
    ) -> None:
        """The vehicle refuses the broker meanwhile: it is busy."""
        world = World()
        vehicle = fenced_vehicle(world)
        placed(vehicle, operators)
        world.edge.plan(first_flight(), geofence=fence())
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        vehicle.plans[FENCE].busy_until = math.inf
        theirs = put_behind_refusal(world, vehicle)
        world.run_until_over(1201)
        world.run(20.0)
        assert vehicle.fence == theirs
        assert not world.app.sessions[1].vehicle.overrides.is_open

    def test_one_that_is_being_put_there_before_a_plans_comes_back_behind_it(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        placed(vehicle, square(half_m=90.0))
        vehicle.plans[FENCE].busy_until = math.inf
        world.edge.plan(first_flight(), geofence=fence())
        theirs = put_behind_refusal(world, vehicle)
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        assert vehicle.fence != theirs
        world.run_until_over(1201)
        world.run(20.0)
        assert vehicle.fence == theirs

    @pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
    def test_one_that_is_put_there_at_once_behind_the_plans_stays(self, script: Script) -> None:
        """Before the vehicle has shown that it holds the plan's, whose mission fails then."""
        world = World()
        vehicle = fenced_vehicle(world, script)
        placed(vehicle, square(half_m=90.0))
        world.edge.plan(first_flight(), geofence=fence())
        world.run_until(lambda: "stored 1" in vehicle.log)
        placed(vehicle, square(north_m=200.0, half_m=70.0))
        theirs = vehicle.fence
        world.run_until_over(1201)
        world.run(60.0)
        assert vehicle.fence == theirs
        assert not world.app.sessions[1].vehicle.overrides.is_open

    def test_a_restarted_broker_removes_the_fence_of_the_mission_that_it_follows(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        world.edge.plan(first_flight(), geofence=fence())
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        world.restart_broker()
        world.run_until_over(1201)
        world.run(20.0)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.log.count("stored 1") == 1
        assert vehicle.fence == []

    def test_the_session_shows_that_something_is_still_to_be_restored(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        fly(world, fence(max_altitude=40.0))
        session = world.app.sessions[1]
        world.run_until(lambda: session.state is State.IDLE)
        assert session.is_restoring
        world.run_until(lambda: not session.is_restoring, within_s=20.0)
        assert vehicle.fence == []
        assert vehicle.values == PX4_VALUES

    def test_a_vehicle_that_refuses_to_take_it_back_is_not_waited_for(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        world.edge.plan(first_flight(), geofence={"max_altitude": 40.0})
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        vehicle.refused_values.add("GF_MAX_VER_DIST")
        world.run_until_over(1201)
        session = world.app.sessions[1]
        world.run_until(lambda: not session.is_restoring, within_s=60.0)
        assert vehicle.values["GF_MAX_VER_DIST"] == 40.0
        vehicle.refused_values.clear()
        world.run(40.0)
        assert vehicle.values == PX4_VALUES

    def test_a_vehicle_that_was_off_gets_it_back_when_it_is_connected_again(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        world.edge.plan(first_flight(), geofence=fence())
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        world.run_until(lambda: not vehicle.armed)
        vehicle.silent = True
        world.run(10.0)
        assert len(vehicle.fence) == 4
        vehicle.silent = False
        world.run(40.0)
        assert vehicle.fence == []
