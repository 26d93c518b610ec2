"""What a geofence forbids, up to which height, and where rally points are left out."""

from dataclasses import replace

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import Message, mavlink
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
    ABLE,
    ARDUPILOT_VALUES,
    FENCE,
    GENERIC,
    PX4_VALUES,
    RALLY,
    fenced_vehicle,
)
from tests.support.geofences import RALLY_POINT, fence, fly, placed, square
from tests.support.mission_reports import message_of
from tests.support.vehicle_script import ARDUPILOT, HOME, PX4, PX4_LAND, PX4_RETURN, Script


class TestChangesByOthers:
    def test_the_report_names_who_has_changed_the_fence_in_flight_once(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        world.edge.plan(first_flight(), geofence=fence())
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        world.run(3.0)
        cleared = mavlink.MAVLink_mission_ack_message(255, 190, 0, mavlink.MAV_MISSION_TYPE_FENCE)
        switched = mavlink.MAVLink_command_ack_message(
            mavlink.MAV_CMD_DO_FENCE_ENABLE, mavlink.MAV_RESULT_ACCEPTED, target_system=255
        )
        for message in (cleared, switched, cleared, switched):
            vehicle.send(message)
            world.run(1.0)
        texts = [
            command.get("message") or ""
            for command in world.edge.reports(1201)[-1]["command_report_array"]
        ]
        assert "; ".join(filter(None, texts)) == (
            "system 255 has changed the geofence of the vehicle; "
            "system 255 has switched the geofence of the vehicle on or off"
        )
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    @pytest.mark.parametrize(
        "message",
        [
            mavlink.MAVLink_mission_ack_message(255, 190, 0, mavlink.MAV_MISSION_TYPE_RALLY),
            mavlink.MAVLink_mission_ack_message(255, 190, 13, mavlink.MAV_MISSION_TYPE_FENCE),
            mavlink.MAVLink_command_ack_message(
                mavlink.MAV_CMD_DO_FENCE_ENABLE, mavlink.MAV_RESULT_DENIED, target_system=255
            ),
        ],
    )
    def test_what_was_refused_or_is_no_fence_is_not_reported(self, message: Message) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        world.edge.plan(first_flight(), geofence=fence())
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        vehicle.send(message)
        world.run_until_over(1201)
        report = world.edge.reports(1201)[-1]["command_report_array"]
        assert not any(command.get("message") for command in report)


class TestHeights:
    def test_px4_guards_the_height_and_returns_below_it(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        world.edge.plan(first_flight(), geofence={"max_altitude": 40.0})
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        assert vehicle.values["GF_MAX_VER_DIST"] == 40.0
        assert vehicle.values["RTL_RETURN_ALT"] == 40.0

    def test_ardupilot_guards_areas_and_height(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world, ARDUPILOT)
        two = {"inclusion": [square(), square(70.0)], "max_altitude": 40.0}
        world.edge.plan(first_flight(), geofence=two)
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        assert vehicle.values == ARDUPILOT_VALUES | {
            "FENCE_ENABLE": 1,
            "FENCE_TYPE": 5,  # Areas and height, not the circle that was not switched on
            "FENCE_ALT_MAX": 40.0,
            "FENCE_OPTIONS": 3,  # One inclusion area is enough
        }
        assert vehicle.set[-1][0] == "FENCE_ENABLE"

    @pytest.mark.parametrize("enabled", [0, 1])
    def test_ardupilot_enforces_what_is_added_to_an_enabled_fence(self, enabled: int) -> None:
        """Since 4.6 a fence type counts when FENCE_ENABLE is set, which it may be already."""
        world = World()
        values = ARDUPILOT_VALUES | {"FENCE_ENABLE": enabled, "FENCE_TYPE": 2}
        vehicle = fenced_vehicle(world, ARDUPILOT, values=values)
        world.edge.plan(first_flight(), geofence=fence(max_altitude=40.0))
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        assert vehicle.enforced_types == (7 if enabled else 5)
        world.run_until_over(1201)
        world.run(20.0)
        assert vehicle.values == values
        assert vehicle.enforced_types == (2 if enabled else 0)

    @pytest.mark.parametrize("automatic", [1, 2, 3])
    def test_ardupilot_keeps_the_fence_that_it_enables_itself(self, automatic: int) -> None:
        """FENCE_AUTOENABLE enables it behind take-off (1, 2) or when it arms (3)."""
        world = World()
        values = {"FENCE_AUTOENABLE": automatic, "FENCE_TYPE": 3, "FENCE_ALT_MAX": 30.0}
        vehicle = fenced_vehicle(world, ARDUPILOT, values=ARDUPILOT_VALUES | values)
        world.edge.plan(first_flight(), geofence=fence(max_altitude=60.0))
        world.run_until(lambda: vehicle.airborne)
        assert vehicle.enforced_types == 7
        assert vehicle.values["FENCE_ALT_MAX"] == 30.0
        world.run_until_over(1201)
        world.run(20.0)
        assert vehicle.values == ARDUPILOT_VALUES | values

    def test_ardupilots_own_lower_limit_holds_where_it_enables_it_itself(self) -> None:
        world = World()
        values = ARDUPILOT_VALUES | {"FENCE_AUTOENABLE": 3, "FENCE_ALT_MAX": 20.0}
        vehicle = fenced_vehicle(world, ARDUPILOT, values=values)
        high = mission(takeoff(altitude=30.0), waypoint(), go_home())
        world.edge.plan(high, geofence={"max_altitude": 60.0})
        world.run_until_over(1201)
        assert "altitude: 30 m is above the vehicle's own limit, 20 m" in message_of(world)
        assert "ordered to arm" not in vehicle.log

    def test_ardupilots_fence_stays_on_until_it_lands_where_it_enables_it_itself(self) -> None:
        """It does so once a flight; the fence of a plan that ends in the air goes all the same."""
        world = World()
        values = ARDUPILOT_VALUES | {"FENCE_AUTOENABLE": 3, "FENCE_TYPE": 3}
        vehicle = fenced_vehicle(world, ARDUPILOT, values=values)
        world.edge.plan(mission(takeoff(), waypoint()), geofence=fence())
        world.run_until_over(1201)
        assert vehicle.airborne
        world.edge.plan(mission(waypoint(1), go_home(2), mission_id=1202))
        world.run_until(lambda: world.edge.status(1202) == Status.RUNNING)
        assert vehicle.values == values | {"FENCE_ENABLE": 1}
        assert vehicle.enforced_types == 3
        assert vehicle.fence == []
        world.run_until_over(1202)
        world.run(20.0)
        assert vehicle.values == values

    @pytest.mark.parametrize(
        ("version", "has_it"), [(0x040503FF, False), (0x040600FF, True), (0, True)]
    )
    def test_a_parameter_is_not_read_of_a_version_that_lacks_it(
        self, version: int, *, has_it: bool
    ) -> None:
        """ArduCopter before 4.6 has no FENCE_AUTOENABLE, and answers nothing."""
        world = World()
        vehicle = fenced_vehicle(world, replace(ARDUPILOT, version=version))
        fly(world, fence())
        assert ("FENCE_AUTOENABLE" in vehicle.asked) == has_it

    def test_a_vehicles_own_lower_limit_stays_and_holds(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world, values=PX4_VALUES | {"GF_MAX_VER_DIST": 20.0})
        high = mission(takeoff(altitude=30.0), waypoint(), go_home())
        world.edge.plan(high, geofence={"max_altitude": 60.0})
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [Status.FAILED, Status.ABORTED, Status.ABORTED]
        assert "altitude: 30 m is above the vehicle's own limit, 20 m" in message_of(world)
        assert vehicle.values["GF_MAX_VER_DIST"] == 20.0
        assert "ordered to arm" not in vehicle.log

    def test_a_mission_at_the_limit_gets_room_to_hold_its_height(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        at_limit = mission(takeoff(altitude=40.0), waypoint(), go_home())
        world.edge.plan(at_limit, geofence={"max_altitude": 40.0})
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        assert vehicle.values["GF_MAX_VER_DIST"] == 42.0

    def test_a_parameter_that_the_vehicle_refuses_fails_the_mission(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        vehicle.refused_values.add("GF_MAX_VER_DIST")
        fly(world, {"max_altitude": 40.0})
        assert world.edge.status(1201) == Status.FAILED
        assert "parameter GF_MAX_VER_DIST" in message_of(world)
        assert "ordered to arm" not in vehicle.log

    def test_for_an_unknown_vehicle_the_report_notes_that_it_keeps_no_height(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world, GENERIC, capabilities=ABLE)
        fly(world, fence(max_altitude=60.0))
        assert world.edge.statuses(1201) == FINISHED
        assert "stored 1" in vehicle.log
        assert "max_altitude: checked by the broker only" in message_of(world)


class TestRefusing:
    """What leads out is refused, as early as it can be known."""

    def test_a_leg_through_an_exclusion_before_the_work_is_accepted(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        world.run(5.0)
        beyond = mission(takeoff(), waypoint(north_m=30.0), go_home())
        work = world.edge.plan(beyond, geofence={"exclusion": [square(15.0, half_m=5.0)]})
        world.run(2.0)
        (answer,) = world.edge.acknowledgements(work)
        why = "latitude, longitude: the leg there enters geofence.exclusion.0"
        assert answer == {"status": "refused", "message": f"command 2: {why}"}
        assert world.edge.statuses(1201) == [Status.ABORTED, Status.FAILED, Status.ABORTED]
        assert world.edge.reports(1201)[-1]["command_report_array"][1]["message"] == why
        assert vehicle.log == []

    def test_a_vehicle_that_stands_outside(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        vehicle.place = HOME[0] - 60.0 * 9e-6, HOME[1]
        fly(world, fence())
        assert world.edge.statuses(1201) == [Status.FAILED, Status.ABORTED, Status.ABORTED]
        assert "the vehicle lies 2" in message_of(world)
        assert "m outside geofence.inclusion" in message_of(world)
        assert vehicle.log == []

    def test_the_return_over_a_forbidden_area(self) -> None:
        """Round it outbound, straight over it on the return."""
        world = World()
        vehicle = fenced_vehicle(world)
        east = {"longitude": HOME[1] + 60.0 * 1.2e-5}
        round_it = mission(
            takeoff(),
            waypoint(2, north_m=0.0, **east),
            waypoint(3, north_m=60.0, **east),
            waypoint(4, north_m=60.0),
            go_home(5),
        )
        world.edge.plan(round_it, geofence={"exclusion": [square(30.0, half_m=10.0)]})
        world.run_until_over(1201)
        assert world.edge.statuses(1201)[-1] == Status.FAILED
        why = "landing: the leg there enters geofence.exclusion.0"
        assert world.edge.reports(1201)[-1]["command_report_array"][-1]["message"] == why
        assert vehicle.log == []


class TestEvents:
    """An emergency is never refused for the fence, and never leads out of it."""

    @pytest.mark.first_case
    @pytest.mark.parametrize(
        ("kind", "mode", "instead"),
        [(1, PX4_LAND, "it lands where it is"), (2, PX4_RETURN, "it returns and lands")],
    )
    def test_a_place_outside_is_left_out_and_reported(
        self, kind: int, mode: int, instead: str
    ) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        world.edge.plan(first_flight(), geofence=fence())
        world.run_until(lambda: vehicle.airborne)
        world.run(1.0)
        outside = {"latitude": HOME[0] + 9e-4, "longitude": HOME[1], "altitude": 5.0}
        event = world.edge.event(kind, abort=outside)
        world.run_until(lambda: not vehicle.armed)
        assert vehicle.custom_mode == mode
        assert mavlink.MAV_CMD_DO_REPOSITION not in vehicle.commands
        done = world.edge.acknowledgements(event)[-1]
        assert done["status"] == "done"
        assert "m outside geofence.inclusion" in done["message"]
        assert done["message"].endswith(instead)

    def test_a_place_inside_is_flown_to(self) -> None:
        world = World()
        vehicle = fenced_vehicle(world)
        world.edge.plan(first_flight(), geofence=fence())
        world.run_until(lambda: vehicle.airborne)
        world.run(1.0)
        inside = {"latitude": HOME[0] + 1e-4, "longitude": HOME[1], "altitude": 5.0}
        event = world.edge.event(1, abort=inside)
        world.run_until(lambda: not vehicle.armed)
        assert mavlink.MAV_CMD_DO_REPOSITION in vehicle.commands
        assert "message" not in world.edge.acknowledgements(event)[-1]


class TestRallyPoints:
    @pytest.mark.first_case
    @PX4_AND_ARDUPILOT
    def test_they_are_stored_before_the_mission_and_removed_after_it(self, script: Script) -> None:
        world = World()
        vehicle = fenced_vehicle(world, script)
        world.edge.plan(first_flight(), geofence=fence(), rally_points=[RALLY_POINT])
        world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
        (point,) = vehicle.plans[RALLY].items
        assert (point.command, point.z) == (5100, 12.5 if script is PX4 else 12.0)
        assert point.x == round(RALLY_POINT["latitude"] * 1e7)
        assert vehicle.log.index("stored 2") < vehicle.log.index("stored 0")
        world.run_until_over(1201)
        world.run(20.0)
        assert vehicle.plans[RALLY].items == []
        assert vehicle.fence == []

    @pytest.mark.thorough
    def test_a_vehicle_that_keeps_none_flies_without_and_the_report_notes_it(self) -> None:
        world = World()
        fenced_vehicle(world, capabilities=mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE)
        world.edge.plan(first_flight(), rally_points=[RALLY_POINT])
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert message_of(world) == "the vehicle keeps no rally points: they were left out"

    def test_a_return_to_one_over_what_is_forbidden_is_refused(self) -> None:
        world = World()
        fenced_vehicle(world)
        beyond = RALLY_POINT | {"latitude": HOME[0] + 40 * 9e-6}
        world.edge.plan(
            first_flight(),
            geofence={"exclusion": [square(25.0, half_m=5.0)]},
            rally_points=[beyond],
        )
        world.run_until_over(1201)
        why = "landing: the leg there enters geofence.exclusion.0"
        assert world.edge.reports(1201)[-1]["command_report_array"][2]["message"] == why


def test_a_vehicle_with_more_items_than_are_kept_fails_the_mission_at_once() -> None:
    """Reading 65,535 of them takes hours, in which the mission would wait."""
    world = World()
    vehicle = fenced_vehicle(world)
    placed(vehicle, square())
    vehicle.plans[FENCE].items *= 1_251
    world.edge.plan(first_flight(), geofence=fence())
    world.run(10.0)
    assert world.edge.status(1201) == Status.FAILED
    assert "geofence could not be read back: it has 5004 items" in message_of(world)
