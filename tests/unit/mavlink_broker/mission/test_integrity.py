"""Another ground station changes the mission in flight: noticed, read back, reported."""

import copy
import dataclasses

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mission.states import State
from mavlink_broker.vehicle.armed_period import STAND_S
from tests.support.broker_world import (
    FINISHED,
    World,
    first_flight,
    go_home,
    mission,
    takeoff,
    waypoint,
)
from tests.support.real_autopilots import COPTER_4_6, PX4_1_14, PX4_1_17
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import Script

AUTOPILOTS = pytest.mark.parametrize(
    "script", [PX4_1_14, PX4_1_17, COPTER_4_6], ids=["px4 1.14", "px4 1.17", "copter"]
)


def planned(script: Script) -> tuple[World, ScriptedVehicle]:
    """A vehicle that is to fly a long mission."""
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(script, item_time_s=6.0))
    waypoints = [waypoint(number, 8.0 * number) for number in range(2, 8)]
    world.edge.plan(mission(takeoff(), *waypoints, go_home(8)))
    return world, vehicle


def flying(script: Script) -> tuple[World, ScriptedVehicle]:
    """A vehicle that has flown a part of it."""
    world, vehicle = planned(script)
    world.run_until(lambda: vehicle.airborne and vehicle.current >= 5)
    return world, vehicle


def moved(items: list[Message], seq: int) -> list[Message]:
    """The same items, one of them elsewhere."""
    others = copy.deepcopy(items)
    others[seq].x += 50_000
    return others


def reason(world: World) -> str:
    return str(world.edge.reports(1201)[-1]["message"])


class TestAnotherMission:
    @pytest.mark.first_case
    @AUTOPILOTS
    def test_of_another_length_fails_the_mission(self, script: Script) -> None:
        world, vehicle = flying(script)
        vehicle.store_foreign_mission(vehicle.items[:-2])
        world.run_until_over(1201, within_s=20.0)
        assert world.edge.status(1201) == Status.FAILED
        assert "put another mission onto the vehicle" in reason(world) or (
            "another mission was put onto the vehicle" in reason(world)
        )

    @pytest.mark.first_case
    @pytest.mark.parametrize("script", [PX4_1_14, COPTER_4_6], ids=["px4 1.14", "copter"])
    def test_whose_transfer_is_received_is_read_back_and_named(self, script: Script) -> None:
        world, vehicle = flying(script)
        vehicle.store_foreign_mission(moved(vehicle.items, 7), acknowledged_to=255)
        world.run_until_over(1201, within_s=20.0)
        assert world.edge.status(1201) == Status.FAILED
        assert reason(world) == (
            "system 255 put another mission onto the vehicle: "
            "item 7 on the vehicle differs in latitude"
        )

    @pytest.mark.parametrize("state", [State.SELECTING, State.ARMING, State.STARTING])
    def test_that_comes_between_the_proof_and_the_flight_fails_the_mission(
        self, state: State
    ) -> None:
        world, vehicle = planned(PX4_1_14)
        world.run_until(lambda: 1 in world.app.sessions and world.app.sessions[1].state is state)
        vehicle.store_foreign_mission(moved(vehicle.items, 7), acknowledged_to=250)
        world.run_until_over(1201, within_s=20.0)
        assert world.edge.status(1201) == Status.FAILED
        assert reason(world) == (
            "system 250 put another mission onto the vehicle: "
            "item 7 on the vehicle differs in latitude"
        )

    @AUTOPILOTS
    @pytest.mark.parametrize("state", [State.ARMING, State.STARTING])
    def test_of_another_length_that_nobody_heard_before_the_flight_fails_it(
        self, script: Script, state: State
    ) -> None:
        """On another link of the vehicle: its number of items alone shows the change."""
        world, vehicle = planned(script)
        world.run_until(lambda: 1 in world.app.sessions and world.app.sessions[1].state is state)
        vehicle.store_foreign_mission(vehicle.items[:-3])
        world.run_until_over(1201, within_s=20.0)
        assert world.edge.status(1201) == Status.FAILED
        assert "another mission" in reason(world)

    def test_that_ardupilot_announces_is_read_back(self) -> None:
        world, vehicle = flying(COPTER_4_6)
        vehicle.store_foreign_mission(moved(vehicle.items, 7))
        vehicle.send_status_text("Flight plan received", mavlink.MAV_SEVERITY_INFO)
        world.run_until_over(1201, within_s=20.0)
        assert "somebody else put another mission onto the vehicle" in reason(world)

    @AUTOPILOTS
    def test_has_the_vehicle_stand_behind_its_landing(self, script: Script) -> None:
        """It was flown for somebody else, who may be walking up to the vehicle."""
        world, vehicle = flying(script)
        vehicle.store_foreign_mission(vehicle.items[:-2])
        world.run_until_over(1201, within_s=20.0)
        world.edge.plan(first_flight(mission_id=1202))
        world.run(5.0)
        vehicle.armed = vehicle.airborne = False
        before = vehicle.arm_orders
        world.run(STAND_S - 1.0)
        assert vehicle.arm_orders == before
        world.run_until(lambda: vehicle.arm_orders > before, within_s=15.0)

    @pytest.mark.first_case
    @AUTOPILOTS
    def test_that_is_ours_uploaded_again_changes_nothing(self, script: Script) -> None:
        world, vehicle = flying(script)
        vehicle.store_foreign_mission(list(vehicle.items), acknowledged_to=255)
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [Status.FINISHED] * 8

    def test_of_a_fence_is_none(self) -> None:
        """Nor is a download, which the other ground station itself acknowledges."""
        world, vehicle = flying(COPTER_4_6)
        encoder = Encoder(1, 1)
        for kind in (mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_MISSION_TYPE_RALLY):
            fence = mavlink.MAVLink_mission_ack_message(255, 190, 0, kind)
            world.air.to_broker(("192.0.2.1", 14581), encoder.encode(fence))
        before = len(world.air.sent)
        world.run(5.0)
        sent = Decoder().decode(b"".join(frame for _, frame in world.air.sent[before:]))
        assert vehicle.airborne
        assert "MISSION_REQUEST_LIST" not in [message.get_type() for message in sent]


class TestAnEarlierItem:
    @pytest.mark.first_case
    @AUTOPILOTS
    def test_set_by_somebody_else_is_reported_and_the_mission_flies_on(
        self, script: Script
    ) -> None:
        world, vehicle = flying(script)
        item = waypoints_begin(vehicle)
        vehicle.begin_at(item)
        world.run(8.0)
        notes = [
            command.get("message") or ""
            for command in world.edge.reports(1201)[-1]["command_report_array"]
        ]
        expected = f"somebody else set the vehicle back to item {item}"
        assert sum(expected in note for note in notes) == 1
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FINISHED
        assert world.edge.statuses(1201) == [*FINISHED, *[Status.FINISHED] * 5]


def waypoints_begin(vehicle: ScriptedVehicle) -> int:
    """The item that flies to the place of the take-off; others follow, and maybe a speed."""
    kinds = [item.command for item in vehicle.items]
    return kinds.index(mavlink.MAV_CMD_NAV_WAYPOINT, kinds.index(mavlink.MAV_CMD_NAV_TAKEOFF))


def moves(world: World, vehicle: ScriptedVehicle, until: int) -> None:
    """Let a vehicle be where its items are, until one of them is current."""

    def is_there() -> bool:
        item = vehicle.items[min(vehicle.current, len(vehicle.items) - 1)]
        if item.command == mavlink.MAV_CMD_NAV_WAYPOINT:
            vehicle.place = item.x / 1e7, item.y / 1e7
        return vehicle.current >= until or not vehicle.armed

    world.run_until(is_there)


class TestALaterItem:
    @pytest.mark.first_case
    @AUTOPILOTS
    @pytest.mark.parametrize("loss", [0.0, 0.2])
    def test_set_by_somebody_else_leaves_commands_out(self, script: Script, loss: float) -> None:
        world, vehicle = far_apart(script, loss)
        first = waypoints_begin(vehicle)
        moves(world, vehicle, first + 3)
        world.run(3.0)
        place = vehicle.place
        vehicle.begin_at(first + 6)
        world.run(3.0)
        assert vehicle.place == place
        moves(world, vehicle, 99)
        world.run_until_over(1201)
        left_out = [
            report["command_id"]
            for report in world.edge.reports(1201)[-1]["command_report_array"]
            if report["command_status_id"] == Status.ABORTED
        ]
        assert world.edge.status(1201) == Status.FINISHED
        assert left_out in ([4, 5], [5, 6])  # Those that lie between
        assert "somebody else set the vehicle on from item" in str(world.edge.reports(1201)[-1])

    @pytest.mark.first_case
    @AUTOPILOTS
    @pytest.mark.parametrize("loss", [0.0, 0.4])
    def test_reached_in_flight_leaves_nothing_out(self, script: Script, loss: float) -> None:
        world, vehicle = far_apart(script, loss)
        moves(world, vehicle, 99)
        world.run_until_over(1201)
        assert set(world.edge.statuses(1201)) == {Status.FINISHED}

    @pytest.mark.first_case
    @AUTOPILOTS
    def test_of_another_mission_fails_the_mission(self, script: Script) -> None:
        world, vehicle = far_apart(script, 0.0)
        moves(world, vehicle, 5)
        world.run(3.0)
        vehicle.store_foreign_mission(vehicle.items[:-1], acknowledged_to=255)
        vehicle.begin_at(8)
        world.run_until_over(1201, within_s=30.0)
        assert world.edge.status(1201) == Status.FAILED

    @pytest.mark.first_case
    @AUTOPILOTS
    def test_of_a_vehicle_that_never_moves_proves_nothing(self, script: Script) -> None:
        world, vehicle = far_apart(script, 0.0)
        world.run_until(lambda: vehicle.airborne and vehicle.current >= 4)
        vehicle.begin_at(8)
        world.run_until_over(1201)
        assert set(world.edge.statuses(1201)) == {Status.FINISHED}


def far_apart(script: Script, loss: float) -> tuple[World, ScriptedVehicle]:
    """A mission over waypoints that are hundreds of metres from one another."""
    world = World(loss=loss, seed=2)  # With these losses it takes off
    vehicle = world.add_vehicle(script=dataclasses.replace(script, item_time_s=6.0))
    waypoints = [waypoint(number, 200.0 * number) for number in range(2, 8)]
    world.edge.plan(mission(takeoff(), *waypoints, go_home(8)))
    world.run_until(lambda: vehicle.airborne, within_s=300.0)
    return world, vehicle
