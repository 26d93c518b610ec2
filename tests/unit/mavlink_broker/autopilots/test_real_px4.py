"""What PX4 does otherwise than expected, by its sources; see also `test_real_autopilots.py`.

`Commander.cpp`, `failsafe.cpp`, `navigator_main.cpp`, `mavlink_receiver.cpp`.
"""

import dataclasses
from typing import ClassVar

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.vehicle.gcs_heartbeat import AWAY_S
from tests.support.broker_events import PAUSE, RESUME, RETURN_HOME
from tests.support.broker_world import (
    FINISHED,
    World,
    first_flight,
    follow,
    go_home,
    image,
    mission,
    takeoff,
    waypoint,
)
from tests.support.real_autopilots import PX4_1_13, PX4_1_14, PX4_1_16, PX4_1_17
from tests.support.vehicle_script import HOME, PX4_HOLD, PX4_MISSION, PX4_RETURN, Script

ATTENDED = dataclasses.replace(
    PX4_1_17, link_loss_action=2, settings={"COM_DL_LOSS_T": 10.0}, item_time_s=30.0
)
"""As `4001_gz_x500` is: without a ground station it returns after 10 s."""


class TestAVehicleThatHasNoOtherGroundStation:
    @pytest.mark.thorough
    def test_flies_on_while_the_broker_is_away_for_a_minute(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=ATTENDED)
        world.edge.plan(first_flight())
        world.run_until(lambda: vehicle.airborne)
        world.run(5.0)
        world.kill_broker()
        world.run(60.0)
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    @pytest.mark.thorough
    def test_has_its_own_patience_back_behind_the_mission(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(ATTENDED, item_time_s=2.0))
        world.edge.plan(first_flight())
        world.run_until(lambda: vehicle.airborne)
        assert vehicle.settings["COM_DL_LOSS_T"] == AWAY_S
        world.run_until_over(1201)
        world.run_until(lambda: vehicle.settings["COM_DL_LOSS_T"] == 10.0, within_s=10.0)

    @pytest.mark.thorough
    def test_that_is_more_patient_by_itself_keeps_that(self) -> None:
        patient = dataclasses.replace(ATTENDED, settings={"COM_DL_LOSS_T": 300.0}, item_time_s=2.0)
        world = World()
        vehicle = world.add_vehicle(script=patient)
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert not vehicle.written


class TestAVehicleWithAFenceOfItsOwn:
    def test_that_agrees_to_go_out_and_stays_fails_the_command_at_once(self) -> None:
        """Its answer does not show the fence: a status text is all."""
        world = World()
        world.add_vehicle(script=dataclasses.replace(PX4_1_17, fence_m=30.0))
        place = {"latitude": HOME[0], "longitude": HOME[1], "orbit_altitude": 8.0}
        circle = place | {"radius": 40.0, "start_point": 1, "orbit_type": 2}
        second = {"command_id": 2, "command_type_id": 7, "parameters": circle}
        world.edge.plan(mission(takeoff(), second, go_home(3)))
        world.run_until_over(1201, within_s=60.0)
        assert world.edge.statuses(1201) == [Status.FINISHED, Status.FAILED, Status.ABORTED]
        assert "Reposition is outside geofence" in world.edge.reports(1201)[-1]["message"]


class TestAVehicleThatLacksParameters:
    @pytest.mark.thorough
    def test_gets_the_full_time_to_follow_behind_slow_parameters(self) -> None:
        """Up to 1.15 it does not answer for a parameter that does not exist."""
        world = World()
        world.add_vehicle(script=PX4_1_13)
        world.run(3.0)
        for _ in range(20):
            world.app.sessions[1].vehicle.round_trip.sample(5.0)
        target = {"latitude": HOME[0], "longitude": HOME[1], "altitude": 10.0}
        second = {"command_id": 2, "command_type_id": 8, "parameters": target}
        world.edge.plan(mission(takeoff(), second, go_home(3)))
        world.run_until_over(1201, within_s=400.0)
        assert world.edge.statuses(1201) == FINISHED


class TestAVehicleThatGetsANewFenceInFlight:
    @pytest.mark.first_case
    @pytest.mark.parametrize("script", [PX4_1_14, PX4_1_16, PX4_1_17], ids=["1.14", "1.16", "1.17"])
    def test_and_may_not_go_on_has_not_finished(self, script: Script) -> None:
        """It stays where it is, in its mission mode, and reports its mission as complete."""
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(script, item_time_s=6.0))
        plan = mission(takeoff(), waypoint(2), waypoint(3, 20.0), go_home(4, landing=False))
        world.edge.plan(plan)
        world.run_until(lambda: world.edge.reports(1201))
        world.run_until(lambda: world.edge.statuses(1201)[1] == Status.RUNNING)
        vehicle.give_up()
        world.run_until_over(1201, within_s=20.0)
        statuses = [Status.FINISHED, Status.FAILED, Status.ABORTED, Status.ABORTED]
        assert world.edge.statuses(1201) == statuses
        assert "the vehicle has given up the mission" in world.edge.reports(1201)[-1]["message"]
        world.run_until(lambda: not vehicle.armed)
        assert vehicle.custom_mode == PX4_RETURN


class TestAVehicleThatAcceptsAModeBeforeItRefusesIt:
    """1.16 and 1.17 answer DO_SET_MODE twice, and at first as accepted (PX4 pull request 27343)."""

    REFUSES: ClassVar = {mavlink.MAV_CMD_DO_SET_MODE: mavlink.MAV_RESULT_TEMPORARILY_REJECTED}

    def test_is_returned_by_another_order(self) -> None:
        script = dataclasses.replace(PX4_1_16, results=self.REFUSES, item_time_s=30.0)
        world = World()
        vehicle = world.add_vehicle(script=script)
        world.edge.plan(first_flight())
        world.run_until(lambda: vehicle.airborne)
        world.run(3.0)
        event = world.edge.event(RETURN_HOME)
        world.run_until(lambda: not vehicle.armed, within_s=60.0)
        world.run(1.0)
        assert vehicle.custom_mode == PX4_RETURN
        assert [one["status"] for one in world.edge.acknowledgements(event)] == ["accepted", "done"]

    def test_that_does_not_start_has_refused_to(self) -> None:
        refuses = {mavlink.MAV_CMD_MISSION_START: mavlink.MAV_RESULT_DENIED, **self.REFUSES}
        world = World()
        world.add_vehicle(script=dataclasses.replace(PX4_1_16, results=refuses))
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert "MAV_CMD_MISSION_START refused" in world.edge.reports(1201)[-1]["message"]


class TestAVehicleThatTakesOffAsItsMissionEnds:
    def test_is_sent_home_as_soon_as_it_shows(self) -> None:
        """It refuses to be disarmed in the air, and its heartbeat shows it up to 1 s later."""
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4_1_17, item_time_s=30.0))
        world.edge.plan(first_flight())
        world.run_until(lambda: vehicle.airborne)
        event = world.edge.event(RETURN_HOME)
        world.run_until(lambda: vehicle.custom_mode == PX4_RETURN, within_s=4.0)
        world.run_until(lambda: not vehicle.armed)
        world.run(1.0)
        assert vehicle.custom_mode == PX4_RETURN
        assert [one["status"] for one in world.edge.acknowledgements(event)] == ["accepted", "done"]


class TestAVehicleThatManagesItsGimbal:
    """It denies directions from anybody who is not in control, its own mission too."""

    def test_looks_where_a_mission_says(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=PX4_1_16)
        world.edge.plan(
            mission(takeoff(), image(2, -90.0), image(3, -90.0), image(4, -45.0, 30.0), go_home(5))
        )
        world.run_until_over(1201, within_s=100.0)
        assert world.edge.status(1201) == Status.FINISHED
        assert vehicle.gimbal.looks == [(-90.0, 0.0), (-90.0, 0.0), (-45.0, 30.0)]

    def test_looks_there_again_behind_a_landing(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=PX4_1_16)
        before = (takeoff(1), image(2, -90.0), go_home(3))
        world.edge.plan(mission(*before, takeoff(4), image(5, -90.0), go_home(6)))
        world.run_until_over(1201, within_s=100.0)
        assert world.edge.status(1201) == Status.FINISHED
        assert vehicle.gimbal.looks == [(-90.0, 0.0)] * 2

    def test_looks_where_a_picture_behind_a_live_command_says(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=PX4_1_16)
        world.add_camera(vehicle)
        world.edge.plan(mission(takeoff(), follow(), image(3, -60.0, 90.0), go_home(4)))
        world.run_until_over(1201, within_s=400.0)
        assert vehicle.gimbal.looks == [(-60.0, 90.0)]
        assert "gimbal" not in str(world.edge.reports(1201)[-1]["command_report_array"])


class TestAVehicleThatResumesAMissionWithPictures:
    def test_begins_again_at_the_place_before_by_itself(self) -> None:
        """Nobody else has set it back."""
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4_1_16, item_time_s=4.0))
        plan = mission(takeoff(1), waypoint(2), image(3, -90.0), waypoint(4, 20.0), go_home(5))
        world.edge.plan(plan)
        world.run_until(lambda: world.edge.reports(1201))
        world.run_until(lambda: world.edge.statuses(1201)[3] == Status.RUNNING, within_s=90.0)
        for event in (PAUSE, RESUME):
            world.edge.event(event)
            world.run(4.0)
        assert vehicle.resumed_at == [3]
        world.run_until_over(1201, within_s=120.0)
        report = world.edge.reports(1201)[-1]
        assert world.edge.status(1201) == Status.FINISHED
        assert "somebody else" not in str(report)


class TestAVehicleThatIsNotArmed:
    def test_is_not_left_in_its_mission_mode(self) -> None:
        """Arming it there, by remote control or ground station, would start its flight."""
        refuses = {mavlink.MAV_CMD_COMPONENT_ARM_DISARM: mavlink.MAV_RESULT_TEMPORARILY_REJECTED}
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4_1_17, results=refuses))
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        world.run(2.0)
        assert world.edge.status(1201) == Status.FAILED
        assert vehicle.custom_mode == PX4_HOLD


class TestAVehicleThatDoesNotTellItsVersion:
    @pytest.mark.thorough
    def test_is_ordered_to_arm_until_it_does(self) -> None:
        """Built from a copy without its tags, as many are: its version is not known."""
        built = dataclasses.replace(PX4_1_17, version=0, ready_to_arm_after_s=20.0)
        world = World()
        world.add_vehicle(script=built)
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED


class TestAVehicleThatIsNotReady:
    @pytest.mark.thorough
    def test_in_its_mission_mode_for_want_of_a_mission_is_taken_out_of_it(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=PX4_1_17)
        vehicle.set_mode(PX4_MISSION)
        world.edge.plan(first_flight())
        world.run_until(lambda: vehicle.armed, within_s=20.0)
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    @pytest.mark.thorough
    def test_is_requested_to_report_why(self) -> None:
        """It sends the reason once, at its start: mostly before a broker or a mission exists."""
        fault = "Preflight Fail: Compass 0 uncalibrated"
        script = dataclasses.replace(PX4_1_17, ready_to_arm_after_s=1e6, fault=fault)
        world = World()
        vehicle = world.add_vehicle(script=script)
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FAILED
        assert fault in world.edge.reports(1201)[-1]["message"]
        asked = vehicle.commands.count(mavlink.MAV_CMD_RUN_PREARM_CHECKS)
        assert 1 < asked < 6


@pytest.mark.thorough
def test_a_return_that_begins_before_a_heartbeat_shows_the_mission_mode_is_flown() -> None:
    """Between two heartbeats PX4 starts the mission and leaves it for AUTO.RTL."""
    world = World()
    quick = {"item_time_s": 0.1, "heartbeats_at_once": False, "return_changes_mode": True}
    vehicle = world.add_vehicle(script=dataclasses.replace(PX4_1_17, **quick))  # type: ignore[arg-type]  # by name
    world.edge.plan(mission(takeoff(1), waypoint(2)))
    world.run_until_over(1201)
    world.edge.plan(mission(go_home(1), mission_id=1202))
    world.run_until_over(1202)
    assert "message" not in world.edge.reports(1202)[-1]
    assert world.edge.statuses(1202) == [Status.FINISHED]
    assert not vehicle.armed
