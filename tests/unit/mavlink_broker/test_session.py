"""Whole missions by the whole broker, and what one must wait for, in simulated time."""

import dataclasses
from datetime import timedelta

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.broker_world import (
    FAMILIES,
    FINISHED,
    World,
    first_flight,
    flying_world,
    go_home,
    land,
    mission,
    takeoff,
    waypoint,
)
from tests.support.vehicle_script import ARDUPILOT, HOME, PX4, PX4_HOLD, Script

RESULT_PATHS = frozenset({"/pose/", "/battery/", "/mission_report/"})


class TestAWholeMission:
    @pytest.mark.first_case
    @FAMILIES
    def test_is_flown_and_every_command_reported(self, script: Script) -> None:
        world = World()
        world.add_vehicle(script=script)
        work = world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FINISHED
        assert world.edge.statuses(1201) == FINISHED
        assert world.edge.acknowledgements(work) == [{"status": "accepted"}]
        assert len(world.edge.bodies("/pose/")) == 3
        assert len(world.edge.bodies("/battery/")) == 3

    def test_is_accepted_when_its_turn_comes(self) -> None:
        """Until then the edge server may cancel or change it, or hold the vehicle."""
        world = flying_world()
        second = world.edge.plan(first_flight(1202))
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        assert world.edge.acknowledgements(second) == []
        world.run_until_over(1202)
        assert world.edge.acknowledgements(second) == [{"status": "accepted"}]

    def test_is_not_flown_if_its_vehicle_is_held_meanwhile(
        self, caplog: pytest.LogCaptureFixture
    ) -> None:
        world = flying_world()
        held, free = (world.edge.plan(first_flight(number)) for number in (1202, 1203))
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        world.edge.closed.add(held)  # Its acceptance is answered 409
        world.run_until_over(1203)
        assert world.edge.reports(1202) == []
        assert world.edge.acknowledgements(free) == [{"status": "accepted"}]
        assert "mission 1202 is not flown" in caplog.text

    @pytest.mark.first_case
    @FAMILIES
    def test_survives_a_link_that_loses_a_fifth_in_each_direction(self, script: Script) -> None:
        for seed in range(3):
            world = World(loss=0.2, seed=seed)
            vehicle = world.add_vehicle(script=script)
            world.run(5.0)
            world.edge.plan(first_flight())
            world.run_until_over(1201)
            assert world.edge.statuses(1201) == FINISHED
            assert vehicle.commands.count(mavlink.MAV_CMD_MISSION_START) >= 1

    @pytest.mark.thorough
    def test_reports_running_first_and_only_one_terminal_status(self) -> None:
        world = flying_world()
        world.run_until_over(1201)
        world.run(60.0)
        statuses = [r["mission_status_id"] for r in world.edge.reports(1201)]
        assert statuses[0] == Status.RUNNING
        assert statuses.count(Status.FINISHED) == 1
        assert statuses == sorted(statuses)

    def test_posts_pose_and_battery_before_the_report_of_a_finished_command(self) -> None:
        world = flying_world()
        world.run_until_over(1201)
        posted = [p.path for p in world.edge.posts if p.path in RESULT_PATHS]
        one = ["/pose/", "/battery/", "/mission_report/"]
        assert posted == ["/mission_report/", *one, *one, *one]

    @pytest.mark.first_case
    @pytest.mark.parametrize("lost", [1, 2, 100])
    @pytest.mark.parametrize("script", [PX4, ARDUPILOT])
    def test_survives_lost_final_acknowledgements(self, script: Script, lost: int) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(script, lost_acknowledgements=lost))
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.uploads == 1

    def test_waits_for_a_vehicle_that_is_busy_with_another_transfer(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, busy_for_s=8.0))
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.uploads == 1

    def test_needs_no_item_reached_messages(self) -> None:
        world = flying_world(dataclasses.replace(PX4, sends_item_reached=False))
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    @pytest.mark.thorough
    def test_is_reported_every_thirty_seconds_although_nothing_changes(self) -> None:
        world = flying_world(dataclasses.replace(PX4, item_time_s=100.0))
        world.run(95.0)
        assert len(world.edge.reports(1201)) == 4

    @pytest.mark.first_case
    @FAMILIES
    def test_ending_in_the_air_finishes_on_arrival_and_the_next_begins_there(
        self, script: Script
    ) -> None:
        world = World()
        vehicle = world.add_vehicle(script=script)
        world.edge.plan(mission(takeoff(), waypoint(), go_home(landing=False)))
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.airborne
        world.edge.plan(first_flight(mission_id=1202))
        world.run_until_over(1202)
        assert world.edge.statuses(1202) == FINISHED
        assert not vehicle.airborne

    def test_a_refusal_in_the_air_leaves_the_vehicle_to_the_next_mission(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.edge.plan(mission(takeoff(), waypoint(), go_home(landing=False)))
        world.run_until_over(1201)
        vehicle.script = dataclasses.replace(PX4, refused_item=2)
        world.edge.plan(first_flight(mission_id=1202))
        world.run_until_over(1202)
        assert world.edge.status(1202) == Status.FAILED
        world.run(5.0)
        assert vehicle.airborne
        assert vehicle.custom_mode == PX4_HOLD
        vehicle.script = PX4
        world.edge.plan(first_flight(mission_id=1203))
        world.run_until_over(1203)
        assert world.edge.statuses(1203) == FINISHED

    def test_landing_at_a_point_finishes_on_the_ground(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.edge.plan(mission(takeoff(), waypoint(), land()))
        world.run_until(lambda: vehicle.airborne)
        world.run_until(lambda: not vehicle.armed)
        world.run_until_over(1201, within_s=5.0)
        assert world.edge.statuses(1201) == FINISHED


class TestWaiting:
    def test_for_a_vehicle_to_be_ready_to_arm(self, caplog: pytest.LogCaptureFixture) -> None:
        caplog.set_level("INFO")
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=20.0))
        world.edge.plan(first_flight())
        world.run(15.0)
        assert vehicle.uploads == 0
        assert caplog.text.count("mission 1201 waits for vehicle 1: it is not ready to arm") == 1
        world.run_until_over(1201)
        assert "mission 1201 no longer waits for vehicle 1" in caplog.text
        assert world.edge.status(1201) == Status.FINISHED

    @pytest.mark.thorough
    def test_in_vain_fails_with_the_last_status_text_of_the_vehicle(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=1e6))
        world.edge.plan(first_flight())
        world.run(30.0)
        vehicle.send_status_text("Preflight Fail: no GPS")
        world.run_until_over(1201, within_s=40.0)
        assert world.edge.reports(1201)[-1]["message"] == (
            "not ready after 60 s: it is not ready to arm (Preflight Fail: no GPS)"
        )

    @pytest.mark.thorough
    def test_for_a_home_that_is_never_sent_ends_with_the_position_on_the_ground(self) -> None:
        """Its two altitudes differ by home's; on the ground it stands where home will be."""
        world = World()
        world.add_vehicle(script=dataclasses.replace(PX4, has_home=False))
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        home = world.app.sessions[1].vehicle.snapshot.home
        assert home is not None
        assert tuple(home) == pytest.approx(HOME)

    def test_for_a_vehicle_that_is_never_connected_ends_too(self) -> None:
        world = World()
        world.edge.plan(first_flight(vehicle_id=9))
        world.run_until_over(1201, within_s=70.0)
        assert world.edge.status(1201) == Status.FAILED
        assert "not connected" in world.edge.reports(1201)[-1]["message"]

    def test_missions_of_one_vehicle_fly_one_after_the_other(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        first, second = first_flight(1), first_flight(2)
        world.edge.plan(first)
        world.edge.plan(second)
        world.run_until_over(1)
        assert world.edge.status(2) is None
        world.run_until_over(2)
        assert vehicle.uploads == 2
        assert world.edge.statuses(2) == FINISHED

    @pytest.mark.parametrize("delay_s", [0.5, 1.0, 1.5])
    def test_a_mission_that_expires_on_its_way_onto_the_vehicle_is_not_flown(
        self, delay_s: float
    ) -> None:
        """Its vehicle is ready at once; a slow link takes longer than the mission may wait."""
        world = World()
        vehicle = world.add_vehicle()
        world.run(5.0)
        world.air.delay(vehicle, delay_s)
        world.run(5.0)
        expires_at = world.clock.utc() + timedelta(seconds=8.0 * delay_s)
        world.edge.plan(first_flight(), expires_at=expires_at.isoformat())
        world.run_until_over(1201, within_s=60.0)
        assert world.edge.status(1201) == Status.ABORTED
        assert "expired before take-off" in world.edge.reports(1201)[-1]["message"]
        world.run(30.0)
        assert not vehicle.armed
        assert not vehicle.airborne

    @pytest.mark.parametrize(
        "refusal", [mavlink.MAV_RESULT_FAILED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED]
    )
    def test_a_vehicle_that_refuses_to_arm_until_the_expiry_is_not_ordered_again(
        self, refusal: int
    ) -> None:
        world = World()
        script = dataclasses.replace(PX4, arms_in=frozenset(), arming_refusal=refusal)
        vehicle = world.add_vehicle(script=script)
        world.edge.plan(first_flight(), expires_at="2026-11-21T08:00:10Z")
        world.run(11.0)
        vehicle.script = PX4
        world.run_until_over(1201, within_s=30.0)
        assert "expired before take-off" in world.edge.reports(1201)[-1]["message"]
        world.run(30.0)
        assert not vehicle.armed

    def test_an_order_to_arm_without_an_answer_is_not_repeated_after_the_expiry(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.edge.plan(first_flight(), expires_at="2026-11-21T08:00:10Z")
        world.run_until(lambda: vehicle.uploads == 1, within_s=9.0)
        world.air.is_uplink_up = False
        world.run(11.0)
        world.air.is_uplink_up = True
        world.run_until_over(1201, within_s=30.0)
        assert "expired before take-off" in world.edge.reports(1201)[-1]["message"]
        world.run(30.0)
        assert not vehicle.armed
        assert not vehicle.airborne

    def test_a_mission_that_has_begun_is_flown_to_its_end_behind_its_expiry(self) -> None:
        """Its second part begins on the ground, behind the expiry."""
        world = World()
        world.add_vehicle()
        parts = mission(takeoff(1), land(2), takeoff(3), go_home(4))
        world.edge.plan(parts, expires_at="2026-11-21T08:00:05Z")
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING, within_s=5.0)
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [Status.FINISHED] * 4

    def test_a_mission_that_expired_behind_another_is_ended_by_the_edge_server_alone(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.edge.plan(first_flight(1))
        second = world.edge.plan(first_flight(2), expires_at="2026-11-21T08:00:05Z")
        world.edge.cancel(second)  # It has ended it at its expiry, and answers so
        world.run(6.0)
        world.edge.answers_acceptances = False
        world.run_until_over(1)
        world.run(10.0)
        world.edge.answers_acceptances = True
        world.edge.plan(first_flight(3))
        world.run_until_over(3)
        assert vehicle.uploads == 2
        assert world.edge.reports(2) == []

    @pytest.mark.thorough
    def test_past_its_expiry_aborts_a_mission(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=50.0))
        world.edge.plan(first_flight(), expires_at="2026-11-21T08:00:30Z")
        world.run_until_over(1201, within_s=40.0)
        assert world.edge.status(1201) == Status.ABORTED
        assert world.edge.statuses(1201) == [Status.ABORTED] * 3
        world.run(60.0)
        assert vehicle.uploads == 0
