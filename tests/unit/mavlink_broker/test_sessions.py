"""Many vehicles, odd ones among them, and what is published of each, in simulated time."""

import dataclasses
import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.codec import Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.session import LONGEST_LOSS_S
from tests.support.broker_world import ELSEWHERE, FINISHED, World, first_flight
from tests.support.orders import orders
from tests.support.real_autopilots import COPTER_4_6, PX4_1_17
from tests.support.scripted_telemetry import STREAMS
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import PX4, Script

SAME_ID = "another vehicle at 198.51.100.7:40000 has the same system id, 1"


def registered(world: World, vehicle_id: int = 1) -> dict[str, Any]:
    """The newest registration of a vehicle."""
    return dict(world.edge.bodies(f"/vehicles/{vehicle_id}")[-1])


def heartbeat(kind: int = mavlink.MAV_TYPE_QUADROTOR, autopilot: int = 12) -> Message:
    return mavlink.MAVLink_heartbeat_message(kind, autopilot, 81, 0, 4, 3)


class TestTheRegistry:
    def test_shows_family_version_and_the_age_of_the_position(self) -> None:
        world = World()
        world.add_vehicle(script=COPTER_4_6)
        world.run(12.0)
        row = registered(world)
        assert row["family"] == "ardupilot"
        assert row["position_age"] <= 1.0
        assert row["stale"] == []
        assert row["warning"] is None

    def test_shows_heading_speed_and_gps(self) -> None:
        world = World()
        world.add_vehicle(script=COPTER_4_6)
        world.run(12.0)
        row = registered(world)
        assert 0.0 <= row["heading"] < 360.0
        assert row["speed"] == pytest.approx(0.0, abs=0.1)

    def test_is_updated_as_often_as_the_edge_server_requests(self) -> None:
        world = World()
        world.add_vehicle()
        world.run(12.0)
        world.edge.update_intervals[1] = 0.4
        world.run(1.0)
        before = len(world.edge.bodies("/vehicles/1"))
        world.run(10.0)
        updates = len(world.edge.bodies("/vehicles/1")) - before
        assert 20 <= updates <= 26
        del world.edge.update_intervals[1]
        world.run(1.0)
        before = len(world.edge.bodies("/vehicles/1"))
        world.run(10.0)
        assert 4 <= len(world.edge.bodies("/vehicles/1")) - before <= 7

    def test_shows_a_frozen_position_as_old_while_the_vehicle_is_connected(self) -> None:
        """Its heartbeats arrive and its position is old: the position does not look fresh."""
        world = World()
        vehicle = world.add_vehicle(script=COPTER_4_6)
        world.run(10.0)
        vectors = len(world.edge.bodies("/state_vector/"))
        vehicle.ignores_intervals = True
        vehicle.stop_stream("position")
        world.run(10.0)
        row = registered(world)
        assert row["link_state"] == "connected"
        assert row["stale"] == ["position"]
        assert row["position_age"] > 5.0
        assert len(world.edge.bodies("/state_vector/")) - vectors <= 6

    def test_names_a_battery_stale_whose_value_is_no_longer_known(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """The edge server still shows the value before: it does not look fresh."""
        world = World()
        world.add_vehicle(script=COPTER_4_6)
        world.run(10.0)
        assert registered(world)["stale"] == []
        unmeasured = mavlink.MAVLink_battery_status_message(
            0, 1, 1, 32767, [65535] * 10, -1, 0, -1, -1
        )
        with monkeypatch.context() as patch:
            patch.setitem(STREAMS, "battery", lambda _: unmeasured)
            world.run(10.0)
            assert registered(world)["stale"] == ["battery"]
        world.run(10.0)
        assert registered(world)["stale"] == []

    def test_names_everything_stale_when_the_link_is_not_connected(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.run(5.0)
        vehicle.silent = True
        world.run(3.0)
        row = registered(world)
        assert row["link_state"] == "stale"
        assert row["stale"] == ["position", "attitude", "battery"]
        world.run(5.0)
        assert registered(world)["link_state"] == "lost"
        assert registered(world)["latitude"] == pytest.approx(40.4434)

    def test_is_not_updated_again_and_again_about_a_lost_vehicle(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.run(5.0)
        vehicle.silent = True
        world.run(10.0)
        before = len(world.edge.bodies("/vehicles/1"))
        world.run(60.0)
        assert len(world.edge.bodies("/vehicles/1")) - before <= 3


class TestALostLink:
    def test_that_comes_back_gets_every_request_again(self) -> None:
        """What was reset meanwhile, or belongs to another radio, is requested again."""
        world = World()
        vehicle = world.add_vehicle(script=COPTER_4_6)
        world.run(10.0)
        vehicle.silent = True
        world.run(20.0)
        for name in ("position", "attitude", "mission"):
            vehicle.stop_stream(name)
        vehicle.silent = False
        world.run(5.0)
        assert registered(world)["stale"] == []
        assert registered(world)["position_age"] < 1.0

    def test_is_no_flight_any_more_after_half_an_hour(self) -> None:
        """The clock of the others would wait for it."""
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, item_time_s=600.0))
        world.edge.plan(first_flight())
        world.run_until(lambda: vehicle.airborne)
        session = world.app.sessions[1]
        vehicle.silent = True
        world.run(60.0)
        assert session.may_fly(world.clock.now)
        world.run(LONGEST_LOSS_S)
        assert not session.may_fly(world.clock.now)


class TestManyVehicles:
    @pytest.mark.thorough
    def test_of_all_families_fly_at_once(self) -> None:
        world = World()
        scripts = (PX4, PX4_1_17, COPTER_4_6, Script(autopilot=mavlink.MAV_AUTOPILOT_GENERIC))
        for system, script in enumerate(scripts, start=1):
            world.add_vehicle(system, script)
            world.edge.plan(first_flight(mission_id=system, vehicle_id=system))
        for system in range(1, len(scripts) + 1):
            world.run_until_over(system)
            assert world.edge.statuses(system) == FINISHED

    @pytest.mark.thorough
    def test_a_flood_from_one_and_a_slow_link_to_another_delay_no_third(self) -> None:
        """One sends 2,000 messages a second, one answers after 1.5 s; the third flies as usual."""
        alone = World()
        alone.add_vehicle(3)
        alone.edge.plan(first_flight(vehicle_id=3))
        alone.run_until_over(1201)
        world = World()
        flooding, slow = world.add_vehicle(1), world.add_vehicle(2)
        world.air.delay(slow, 0.75)
        world.add_vehicle(3)
        flood = Encoder(1, 1)
        noise = mavlink.MAVLink_vfr_hud_message(1.0, 2.0, 3, 4, 5.0, 6.0)
        address = next(a for a, v in world.air.vehicles.items() if v is flooding)
        for system in (2, 3):
            world.edge.plan(first_flight(mission_id=1200 + system, vehicle_id=system))
        while (world.edge.status(1203) or 0) < Status.FINISHED:
            for _ in range(40):
                world.air.to_broker(address, flood.encode(noise))
            world.tick()
        assert world.clock.now <= alone.clock.now + 0.5
        world.run_until_over(1202)
        assert world.edge.statuses(1202) == FINISHED


class TestOddOnes:
    @pytest.mark.thorough
    def test_a_scan_of_all_numbers_ends_nothing_and_leaves_nothing(self) -> None:
        world = World()
        world.add_vehicle(1, dataclasses.replace(PX4, item_time_s=0.3))
        for system in range(256):
            world.air.to_broker(ELSEWHERE, Encoder(system, 1).encode(heartbeat()))
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert len(world.app.sessions) <= 255
        for _ in range(160):
            world.clock.now += 0.5
            world.air.step()
            world.app.step(0.0)
        assert set(world.app.sessions) == {1}

    @pytest.mark.parametrize(
        ("kind", "autopilot", "component"),
        [
            (mavlink.MAV_TYPE_GCS, 8, 190),
            (mavlink.MAV_TYPE_GIMBAL, 8, 154),
            (mavlink.MAV_TYPE_CAMERA, 8, 100),
            (mavlink.MAV_TYPE_ADSB, 8, 156),
            (mavlink.MAV_TYPE_ONBOARD_CONTROLLER, 8, 191),
            (mavlink.MAV_TYPE_GENERIC, 8, 1),
        ],
    )
    def test_what_does_not_fly_is_no_vehicle(
        self, kind: int, autopilot: int, component: int
    ) -> None:
        world = World()
        world.air.to_broker(ELSEWHERE, Encoder(7, component).encode(heartbeat(kind, autopilot)))
        world.run(2.0)
        assert world.app.sessions == {}

    def test_another_vehicle_with_the_same_number_is_reported_and_not_flown(self) -> None:
        world = World()
        world.run(50.0)
        vehicle = world.add_vehicle(1)
        world.edge.plan(first_flight())
        world.run_until(lambda: vehicle.airborne)
        other = ScriptedVehicle(1, PX4, booted_at=world.clock.now - 40.0)
        world.air.vehicles[ELSEWHERE] = other
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert other.commands == []
        assert vehicle.uploads == 1
        assert registered(world)["warning"] == SAME_ID

    def test_of_two_vehicles_with_one_number_none_takes_off(self) -> None:
        """Nobody knows for which one the mission is; it waits until one is gone."""
        world = World()
        world.run(50.0)
        vehicle = world.add_vehicle(1)
        other = ScriptedVehicle(1, PX4, booted_at=world.clock.now - 40.0)
        world.run(0.1)
        world.air.vehicles[ELSEWHERE] = other
        world.run(5.0)
        world.edge.plan(first_flight())
        world.run(40.0)
        assert vehicle.uploads == other.uploads == 0
        del world.air.vehicles[ELSEWHERE]
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert (vehicle.uploads, other.uploads) == (1, 0)

    def test_a_mission_for_one_of_two_vehicles_with_one_number_fails_by_its_reason(self) -> None:
        world = World()
        world.run(50.0)
        vehicle = world.add_vehicle(1)
        world.air.vehicles[ELSEWHERE] = ScriptedVehicle(1, PX4, booted_at=world.clock.now - 40.0)
        world.run(5.0)
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FAILED
        assert world.edge.reports(1201)[-1]["message"] == f"not ready after 60 s: {SAME_ID}"
        assert vehicle.uploads == 0

    def test_a_vehicle_behind_a_new_port_flies_on(self) -> None:
        """A router gave it another port in the middle of its mission."""
        world = World()
        vehicle = world.add_vehicle(1)
        world.edge.plan(first_flight())
        world.run_until(lambda: vehicle.airborne)
        world.air.vehicles = {ELSEWHERE: vehicle}
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        states = [body["link_state"] for body in world.edge.bodies("/vehicles/1")]
        assert "lost" not in states

    @pytest.mark.parametrize("appears", ["before", "in the silence"])
    def test_another_vehicle_with_the_same_number_takes_no_mission_over(self, appears: str) -> None:
        """The first one is silent for seconds; the second one was switched on before it."""
        world = World()
        world.run(50.0)
        vehicle = world.add_vehicle(1, dataclasses.replace(PX4, item_time_s=8.0))
        world.edge.plan(first_flight())
        world.run_until(lambda: vehicle.airborne)
        other = ScriptedVehicle(1, PX4, booted_at=world.clock.now - 40.0)
        if appears == "before":
            world.air.vehicles[ELSEWHERE] = other
            world.run(3.0)
        vehicle.silent = True
        world.run(2.0)
        world.air.vehicles[ELSEWHERE] = other
        world.run(10.0)
        assert registered(world)["warning"] == SAME_ID
        assert registered(world)["link_state"] == "lost"
        vehicle.silent = False
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert other.commands == []

    def test_another_vehicle_that_takes_its_place_does_not_fly_its_mission(self) -> None:
        """The first one does not come back: the mission fails, and nothing is ordered."""
        world = World()
        world.run(50.0)
        vehicle = world.add_vehicle(1, dataclasses.replace(PX4, item_time_s=8.0))
        world.edge.plan(first_flight())
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING and vehicle.airborne)
        world.run(4.0)
        other = ScriptedVehicle(1, PX4, booted_at=world.clock.now - 40.0)
        other.items = list(vehicle.items)
        other.armed = other.airborne = True
        other.custom_mode = vehicle.custom_mode
        world.air.vehicles[ELSEWHERE] = other
        world.run(3.0)
        vehicle.silent = True
        world.run(50.0)
        assert world.edge.status(1201) == Status.RUNNING
        since = len(other.frames)
        world.run_until_over(1201, within_s=20.0)
        reason = "another vehicle with its system id is received in its place"
        assert world.edge.status(1201) == Status.FAILED
        assert world.edge.reports(1201)[-1]["message"] == reason
        world.run(10.0)
        assert orders(other, since) == []

    def test_another_vehicle_that_takes_its_place_has_no_log_of_its_flight(self) -> None:
        """It stands on the ground, which is no landing of the one that flew."""
        world = World()
        world.run(50.0)
        vehicle = world.add_vehicle(1, dataclasses.replace(PX4, item_time_s=8.0))
        world.edge.plan(first_flight())
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING and vehicle.airborne)
        other = ScriptedVehicle(1, PX4, booted_at=world.clock.now - 40.0)
        world.air.vehicles[ELSEWHERE] = other
        world.run(3.0)
        vehicle.silent = True
        world.run_until_over(1201, within_s=80.0)
        world.run(60.0)
        received = {message.get_type() for message in other.frames}
        assert "HEARTBEAT" in received
        assert "LOG_REQUEST_LIST" not in received

    def test_a_vehicle_that_was_restarted_behind_a_new_port_does_not_fly_its_mission(self) -> None:
        world = World()
        vehicle = world.add_vehicle(1, dataclasses.replace(PX4, item_time_s=8.0))
        world.run(50.0)
        world.edge.plan(first_flight())
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING and vehicle.airborne)
        world.run(4.0)
        world.air.vehicles = {}
        world.run(3.0)
        vehicle.reboot(world.clock.now)
        world.air.vehicles = {ELSEWHERE: vehicle}
        world.run_until_over(1201, within_s=30.0)
        assert world.edge.status(1201) == Status.FAILED
        assert "the vehicle was restarted" in world.edge.reports(1201)[-1]["message"]

    def test_a_vehicle_that_gets_another_number_is_another_vehicle(self) -> None:
        world = World()
        vehicle = world.add_vehicle(1)
        world.run(5.0)
        vehicle.renumber(4)
        world.edge.plan(first_flight(vehicle_id=4))
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert registered(world, 1)["link_state"] == "lost"


NUMBERS = st.floats(width=32) | st.sampled_from([math.nan, math.inf, -math.inf, 1e30])


def named_values(signed: int, unsigned: int, number: float) -> list[Message]:
    """Telemetry that has one odd number everywhere."""
    byte, short = unsigned & 0xFF, unsigned & 0xFFFF
    low, little = (signed & 0xFFFF) - 32768, (signed & 0xFF) - 128
    return [
        mavlink.MAVLink_heartbeat_message(2, 12, byte, unsigned, byte, 3),
        mavlink.MAVLink_global_position_int_message(
            unsigned, signed, signed, signed, signed, low, low, low, short
        ),
        mavlink.MAVLink_attitude_message(unsigned, *[number] * 6),
        mavlink.MAVLink_home_position_message(
            *[signed] * 3, *[number] * 3, [number] * 4, *[number] * 3
        ),
        mavlink.MAVLink_battery_status_message(
            0, 1, 1, low, [short] * 10, low, signed, signed, little
        ),
        mavlink.MAVLink_extended_sys_state_message(byte, byte),
        mavlink.MAVLink_sys_status_message(
            *[unsigned] * 3, short, short, low, little, *[short] * 6
        ),
        mavlink.MAVLink_mission_current_message(short, short, byte, byte),
        mavlink.MAVLink_mission_item_reached_message(short),
        mavlink.MAVLink_system_time_message(unsigned, unsigned),
        mavlink.MAVLink_param_value_message(b"BAT1_CAPACITY", number, 9, short, short),
        mavlink.MAVLink_autopilot_version_message(
            unsigned, unsigned, unsigned, unsigned, unsigned, *[[byte] * 8] * 3, short, short, 0
        ),
        mavlink.MAVLink_statustext_message(byte % 8, bytes([byte]) * 50, short, byte),
        mavlink.MAVLink_command_ack_message(short, byte, byte, signed, 254, 191),
    ]


@pytest.mark.thorough
@settings(max_examples=25, deadline=None)
@given(st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1), NUMBERS)
def test_no_telemetry_ends_the_broker_or_leaves_it_with_what_cannot_be(
    signed: int, unsigned: int, number: float
) -> None:
    """Whatever a vehicle sends in flight: what is posted is valid, and the loop goes on."""
    world = World()
    vehicle = world.add_vehicle(1, dataclasses.replace(PX4, item_time_s=0.2))
    world.edge.plan(first_flight())
    world.run_until(lambda: vehicle.airborne)
    encoder = Encoder(1, 1)
    for message in named_values(signed, unsigned, number):
        world.air.to_broker(("192.0.2.1", 14581), encoder.encode(message))
        world.tick()
    world.run(0.5)
    for body in (*world.edge.bodies("/state_vector/"), *world.edge.bodies("/pose/")):
        assert -90 <= body["latitude"] <= 90
        assert 0 <= body["yaw"] < 360
        assert all(math.isfinite(v) for v in body.values() if isinstance(v, float))
