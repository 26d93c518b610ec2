"""Several vehicles, what is published of them, and other senders, in simulated time."""

import dataclasses

import pytest

from mavlink_broker.config import Config
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import AUTOPILOT, mavlink
from mavlink_broker.mission.states import State
from tests.support.broker_world import (
    FINISHED,
    World,
    first_flight,
    flying_world,
    go_home,
    mission,
    takeoff,
    waypoint,
)
from tests.support.vehicle_script import ARDUPILOT, PX4, PX4_POSITION


class TestSeveralVehicles:
    def test_fly_at_once_each_its_own_mission(self) -> None:
        world = World()
        vehicles = [world.add_vehicle(system) for system in (1, 2, 3)]
        for system in (1, 2, 3):
            world.edge.plan(first_flight(mission_id=1200 + system, vehicle_id=system))
        world.run_until(lambda: all(vehicle.airborne for vehicle in vehicles), within_s=10.0)
        for system in (1, 2, 3):
            world.run_until_over(1200 + system)
            assert world.edge.statuses(1200 + system) == FINISHED
        assert [vehicle.uploads for vehicle in vehicles] == [1, 1, 1]

    def test_a_silent_one_does_not_delay_another(self) -> None:
        world = World()
        silent = world.add_vehicle(1)
        world.add_vehicle(2, ARDUPILOT)
        world.run(3.0)
        silent.silent = True
        world.edge.plan(first_flight(mission_id=1, vehicle_id=1))
        world.edge.plan(first_flight(mission_id=2, vehicle_id=2))
        world.run_until_over(2, within_s=40.0)
        assert world.edge.statuses(2) == FINISHED

    def test_may_carry_other_numbers_than_their_system_ids(self) -> None:
        world = World(config=Config(vehicle_of_system={1: 70}))
        vehicle = world.add_vehicle(1)
        world.edge.plan(first_flight(vehicle_id=70))
        world.run_until_over(1201)
        assert vehicle.uploads == 1
        assert {b["vehicle_id"] for b in world.edge.bodies("/state_vector/")} == {70}

    def test_the_mission_of_another_vehicle_is_not_flown_by_a_renumbered_one(self) -> None:
        world = World(config=Config(vehicle_of_system={1: 70}))
        vehicle = world.add_vehicle(1)
        work = world.edge.plan(first_flight(vehicle_id=1))
        world.run(30.0)
        assert vehicle.uploads == 0
        assert world.edge.acknowledgements(work)[0]["status"] == "refused"


def test_messages_of_one_step_are_answered_in_that_step() -> None:
    """The items that a vehicle asks for wait for no tick: a long mission is uploaded as it asks."""
    world = World()
    world.add_vehicle()
    world.run(3.0)
    world.edge.plan(mission(takeoff(), *(waypoint(number) for number in range(2, 31)), go_home(31)))
    world.run_until(lambda: world.app.sessions[1].state is State.UPLOADING, within_s=10.0)
    (address,) = world.air.vehicles
    encoder = Encoder(1, 1)
    before = len(world.air.sent)
    for seq in range(30):
        request = mavlink.MAVLink_mission_request_int_message(254, 191, seq)
        world.air.to_broker(address, encoder.encode(request))
    world.app.step(0.0)
    sent = [m for _, frame in world.air.sent[before:] for m in Decoder().decode(frame)]
    items = [message.seq for message in sent if message.get_type() == "MISSION_ITEM_INT"]
    assert items[-30:] == list(range(30))


class TestPosting:
    def test_a_vehicle_is_introduced_at_first_sight_with_what_is_known(self) -> None:
        world = World()
        world.add_vehicle()
        world.run(3.0)
        assert world.edge.posts[0].path == "/vehicles/1"
        update = world.edge.bodies("/vehicles/1")[-1]
        assert update["link_state"] == "connected"
        assert update["autopilot"] == "px4"
        assert update["mode"] == "AUTO.LOITER"
        assert update["armed"] is False
        assert update["mission_id"] is None

    def test_a_change_of_mode_is_published_at_once(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.run(3.0)
        vehicle.set_mode(PX4_POSITION)
        world.run(0.1)
        assert world.edge.bodies("/vehicles/1")[-1]["mode"] == "POSCTL"

    def test_a_state_vector_is_published_every_second_while_the_vehicle_is_connected(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.run(1.0)
        before = len(world.edge.bodies("/state_vector/"))
        world.run(10.0)
        assert 9 <= len(world.edge.bodies("/state_vector/")) - before <= 10
        vehicle.silent = True
        world.run(3.0)
        before = len(world.edge.bodies("/state_vector/"))
        world.run(10.0)
        assert len(world.edge.bodies("/state_vector/")) == before

    def test_a_wish_for_the_latest_state_is_answered_at_once_by_every_vehicle(self) -> None:
        world = World()
        world.add_vehicle(1)
        world.add_vehicle(2)
        world.run(5.1)
        before = len(world.edge.bodies("/state_vector/"))
        work = world.edge.request_state()
        world.tick()
        new = world.edge.bodies("/state_vector/")[before:]
        assert {body["vehicle_id"] for body in new} == {1, 2}
        assert world.edge.acknowledgements(work) == [{"status": "done"}]

    def test_a_wish_for_a_vehicle_that_is_not_there_is_refused(self) -> None:
        world = World()
        work = world.edge.request_state(5)
        world.tick()
        assert world.edge.acknowledgements(work)[0]["status"] == "refused"

    def test_battery_size_is_read_from_the_vehicle_else_from_the_configuration(self) -> None:
        sizes = []
        for capacity in (4200.0, None):
            world = World()
            world.add_vehicle(script=dataclasses.replace(PX4, battery_capacity_mah=capacity))
            world.run(20.0)
            sizes.append(world.edge.bodies("/state_vector/")[-1]["battery_capacity"])
        assert sizes == [4.2, 5.2]


class TestStrangers:
    @pytest.mark.parametrize(
        "kind",
        [mavlink.MAV_TYPE_GCS, mavlink.MAV_TYPE_CAMERA, mavlink.MAV_TYPE_ONBOARD_CONTROLLER],
    )
    def test_that_do_not_fly_are_no_vehicles(self, kind: int) -> None:
        world = World()
        world.add_vehicle(script=dataclasses.replace(PX4, vehicle_type=kind))
        world.run(3.0)
        assert world.app.sessions == {}

    def test_other_components_do_not_count_as_the_vehicle(self) -> None:
        world = World()
        world.add_vehicle()
        world.run(3.0)
        camera = Encoder(1, 100)
        far = mavlink.MAVLink_global_position_int_message(0, 100, 100, 0, 0, 0, 0, 0, 0)
        world.air.to_broker(("192.0.2.1", 14581), camera.encode(far))
        world.run(0.05)
        position = world.app.sessions[1].vehicle.snapshot.position
        assert position is not None
        assert position.latitude_deg == pytest.approx(40.4434)

    def test_hostile_bytes_change_nothing(self) -> None:
        world = flying_world()
        address = ("192.0.2.1", 14581)
        for data in (b"", b"\xfd", b"\xfd\xff" + b"\0" * 300, bytes(range(256)) * 3):
            world.air.to_broker(address, data)
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    def test_impossible_values_are_dropped(self) -> None:
        world = World()
        world.add_vehicle()
        world.run(3.0)
        encoder = Encoder(1, AUTOPILOT)
        for latitude in (2**31 - 1, -(2**31), 910_000_000):
            message = mavlink.MAVLink_global_position_int_message(
                9000, latitude, 0, 0, 0, 0, 0, 0, 0
            )
            world.air.to_broker(("192.0.2.1", 14581), encoder.encode(message))
        nan = float("nan")
        attitude = mavlink.MAVLink_attitude_message(9000, nan, nan, nan, 0, 0, 0)
        world.air.to_broker(("192.0.2.1", 14581), encoder.encode(attitude))
        world.run(3.0)
        for body in world.edge.bodies("/state_vector/"):
            assert body["latitude"] == pytest.approx(40.4434)
            assert body["yaw"] == pytest.approx(270.0)

    def test_invalid_work_is_refused_and_the_rest_continues(self) -> None:
        world = World()
        world.add_vehicle()
        broken = first_flight()
        broken["command_array"][0]["parameters"]["latitude"] = 91
        bad = world.edge.plan(broken)
        world.edge.plan(first_flight(mission_id=2))
        world.run_until_over(2)
        assert world.edge.acknowledgements(bad)[0]["status"] == "refused"
        assert world.edge.statuses(2) == FINISHED
