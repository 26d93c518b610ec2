"""A restarted broker knows where it has left a vehicle, and where it has sent it."""

from dataclasses import replace
from pathlib import Path

import pytest

from afarcloud.enumerations import EventType, Status
from mavlink_broker.journal import decode_record
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.session import WAITS_FOR_LANDING
from tests.support.broker_world import (
    FAMILIES,
    FINISHED,
    World,
    first_flight,
    go_home,
    mission,
    takeoff,
    waypoint,
)
from tests.support.mission_scenes import SONAR, alarmed_world
from tests.support.scripted_disk import DISK_LAG_S
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_RETURN,
    PX4,
    PX4_LAND,
    PX4_POSITION,
    PX4_RETURN,
    Script,
)

RETURN = mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
FIRST = mission(takeoff(), waypoint())
SECOND = mission(waypoint(1, north_m=20.0), waypoint(2, north_m=25.0), go_home(3), mission_id=1202)


def hovering_world(folder: Path, script: Script = PX4) -> World:
    """A world whose vehicle hovers where a finished mission has left it."""
    world = World(journal=folder, disk_lag_s=DISK_LAG_S)
    world.add_vehicle(script=script)
    world.edge.plan(FIRST)
    world.run_until_over(1201)
    return world


class TestHover:
    @pytest.mark.first_case
    @FAMILIES
    def test_the_next_mission_begins_there(self, tmp_path: Path, script: Script) -> None:
        world = hovering_world(tmp_path, script)
        world.run(0.1)
        world.kill_broker()
        world.run(5.0)
        world.edge.plan(SECOND)
        world.restart_broker()
        world.run_until_over(1202)
        assert world.edge.statuses(1202) == FINISHED
        warnings = {body["warning"] for body in world.edge.bodies("/vehicles/1")}
        assert WAITS_FOR_LANDING not in warnings
        world.run_until(lambda: not list(tmp_path.iterdir()))

    def test_the_same_mission_again_is_flown_again(self, tmp_path: Path) -> None:
        """An autopilot that stays in its mission mode holds what the next mission is."""
        world = hovering_world(tmp_path, ARDUPILOT)
        world.edge.plan(FIRST | {"mission_id": 1202})
        world.edge.take_work()
        world.edge.work[2]["state"] = "accepted"
        world.restart_broker()
        world.run_until_over(1202)
        assert world.edge.statuses(1202) == [Status.FINISHED] * 2
        assert world.only_vehicle.uploads == 2

    @pytest.mark.first_case
    @pytest.mark.parametrize("what", ["elsewhere", "flown by hand"])
    def test_a_vehicle_that_somebody_has_taken_meanwhile_gets_no_order(
        self, tmp_path: Path, what: str
    ) -> None:
        world = hovering_world(tmp_path)
        world.kill_broker()
        if what == "elsewhere":
            latitude, longitude = world.only_vehicle.place
            world.only_vehicle.place = latitude + 50 * 9e-6, longitude
        else:
            world.only_vehicle.custom_mode = PX4_POSITION
        world.edge.plan(SECOND)
        world.restart_broker()
        world.run(20.0)
        assert world.edge.status(1202) is None
        assert world.only_vehicle.uploads == 1

    def test_without_a_journal_the_next_mission_waits_for_the_landing(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.edge.plan(FIRST)
        world.run_until_over(1201)
        world.edge.plan(first_flight(mission_id=1202))
        world.restart_broker()
        world.run(20.0)
        assert world.edge.status(1202) is None
        assert world.edge.bodies("/vehicles/1")[-1]["warning"] == WAITS_FOR_LANDING
        vehicle.armed = vehicle.airborne = False
        world.run_until_over(1202)
        assert world.edge.statuses(1202) == FINISHED
        assert world.edge.bodies("/vehicles/1")[-1]["warning"] is None


class TestReturn:
    @pytest.mark.first_case
    @pytest.mark.parametrize(
        ("script", "mode", "killed_after_s"),
        [
            *((PX4, PX4_RETURN, after_s) for after_s in (0.0, 0.04, 3.0)),
            (ARDUPILOT, COPTER_RETURN, 0.2),
        ],
    )
    def test_the_order_of_an_alarm_outlives_the_broker(
        self, tmp_path: Path, script: Script, mode: int, killed_after_s: float
    ) -> None:
        """The alarm is reported only when the journal holds the return."""
        world = alarmed_world(tmp_path, script)
        vehicle = world.only_vehicle
        world.run(killed_after_s)
        is_reported = world.edge.status(1201) == Status.FAILED
        world.kill_broker()
        world.air.is_uplink_up = True
        world.run(1.0)
        world.restart_broker()
        if is_reported:
            world.run_until(lambda: vehicle.custom_mode == mode, within_s=20.0)
            world.run_until(lambda: not vehicle.armed)
            assert world.edge.statuses(1201)[-1] == Status.ABORTED
            world.run(2.0)  # A vehicle that stands needs no notes any more
            assert not list(tmp_path.iterdir())
        else:
            assert not world.edge.bodies("/alarm/")

    def test_a_failure_without_a_report_is_reported_later(self, tmp_path: Path) -> None:
        """Noted, and the edge server was away."""
        world = alarmed_world(tmp_path)
        world.run(1.0)
        world.kill_broker()
        world.air.is_uplink_up = True
        world.edge.closed.clear()
        running = next(r for r in world.edge.reports(1201) if r["mission_status_id"] == 2)
        world.edge.work[1]["report"] = running
        reported = len(world.edge.reports(1201))
        world.restart_broker()
        world.run_until(lambda: len(world.edge.reports(1201)) > reported)
        report = world.edge.reports(1201)[-1]
        assert report["mission_status_id"] == Status.FAILED
        assert report["message"] == world.edge.bodies("/alarm/")[0]["message"]
        world.run_until(lambda: not world.only_vehicle.armed)

    def test_an_order_that_was_obeyed_is_not_repeated(self, tmp_path: Path) -> None:
        world = alarmed_world(tmp_path)
        vehicle = world.only_vehicle
        world.air.is_uplink_up = True
        world.run_until(lambda: vehicle.custom_mode == PX4_RETURN)
        world.run(3.0)
        given = vehicle.commands.count(RETURN)
        vehicle.custom_mode = PX4_POSITION
        world.restart_broker()
        world.run(20.0)
        assert vehicle.commands.count(RETURN) == given
        assert vehicle.custom_mode == PX4_POSITION

    def test_an_abort_that_came_meanwhile_has_precedence(self, tmp_path: Path) -> None:
        world = alarmed_world(tmp_path)
        vehicle = world.only_vehicle
        world.run(1.0)
        world.kill_broker()
        world.air.is_uplink_up = True
        event = world.edge.event(EventType.ABORT_MISSION)
        world.edge.work[event]["state"] = "accepted"
        world.restart_broker()
        world.run_until(lambda: not vehicle.armed)
        assert vehicle.custom_mode == PX4_LAND


def orders_descent(record: Path) -> bool:
    """Whether a record on the disk orders an abort, or a return after an alarm."""
    _, noted = decode_record(record.read_bytes())
    return noted.abort is not None or noted.pending_return is not None


class TestOrdersOfAnEarlierFlight:
    """The disk took no note that they were over, and the drone flies another mission since."""

    def flies_again(
        self, folder: Path, script: Script, event: EventType | None, *, is_answer_lost: bool = False
    ) -> World:
        """A restarted broker, whose journal still orders what the first flight was ended by."""
        world = World(journal=folder, disk_lag_s=DISK_LAG_S)
        vehicle = world.add_vehicle(script=replace(script, item_time_s=12.0))
        vehicle.booted_at -= 100.0
        world.edge.plan(mission(takeoff(), waypoint(), go_home()))
        world.run_until(lambda: vehicle.airborne and world.edge.status(1201) == Status.RUNNING)
        world.run(3.0)
        if event is None:
            vehicle.ill = SONAR
        else:
            world.edge.event(event)
        world.run_until(lambda: any(map(orders_descent, folder.iterdir())))
        assert world.disk is not None
        world.disk.refuses = True
        world.run_until_over(1201)
        world.run_until(lambda: not vehicle.armed)
        vehicle.ill = 0
        world.edge.plan(mission(takeoff(), waypoint(), go_home(), mission_id=1202))
        world.run_until(lambda: vehicle.airborne and world.edge.status(1202) == Status.RUNNING)
        world.run(3.0)
        world.disk.refuses = False
        if is_answer_lost:
            world.edge.work[2]["state"] = "accepted"
        world.restart_broker()
        return world

    @pytest.mark.first_case
    @pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
    @pytest.mark.parametrize("event", [EventType.ABORT_MISSION, EventType.RETURN_HOME, None])
    def test_they_are_not_carried_out_again(
        self, tmp_path: Path, script: Script, event: EventType | None
    ) -> None:
        world = self.flies_again(tmp_path, script, event)
        world.edge.take_work()  # It arrives late
        world.run(4.0)
        world.edge.hand_out_again()
        world.run_until_over(1202)
        assert world.edge.status(1202) == Status.FINISHED
        world.run(2.0)
        assert world.app.sessions[1].vehicle.recovery.abort is None

    def test_an_abort_that_the_edge_server_still_hands_out_has_its_answer(
        self, tmp_path: Path
    ) -> None:
        """Its `done` was lost with the disk of the broker."""
        world = self.flies_again(tmp_path, PX4, EventType.ABORT_MISSION, is_answer_lost=True)
        world.run_until_over(1202)
        assert world.edge.status(1202) == Status.FINISHED
        assert world.edge.acknowledgements(2)[-1]["status"] == "refused"
