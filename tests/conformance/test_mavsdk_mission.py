"""MAVSDK's mission, geofence and follow-me plugins, and a plan of QGroundControl's."""

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from mavsdk.plugins.follow_me import Config, FollowMe, FollowMeError, TargetLocation
from mavsdk.plugins.geofence import Circle, FenceType, Geofence, GeofenceData, Point, Polygon
from mavsdk.plugins.mission import Mission, MissionItem, MissionPlan
from mavsdk.plugins.mission_raw import MissionRaw
from mavsdk.plugins.telemetry import FlightMode

from tests.conformance.mavsdk_client import ALTITUDE_AMSL_M, Pilot, as_text, connected, place
from tests.support.system import wait_for

pytestmark = pytest.mark.scenario

SYSTEM = 7
SPEED = 2  # The target that MAVSDK sends each second must not expire in between
FOLLOWING_M = 8.0
EAST_M = 18.0  # Where vehicle 7 stands
TAKEOFF, WAYPOINT, RETURN, RALLY = 22, 16, 20, 5100


class Client(NamedTuple):
    """MAVSDK's plugins on one vehicle."""

    pilot: Pilot
    mission: Any
    raw: Any
    geofence: Any
    follow_me: Any


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    with connected(SYSTEM, SPEED, tmp_path_factory.mktemp("vehicle")) as system:
        yield Client(
            Pilot(system), Mission(system), MissionRaw(system), Geofence(system), FollowMe(system)
        )


def waypoint(north_m: float, east_m: float, **fields: Any) -> MissionItem:
    """A point 8 m high, flown through."""
    latitude_deg, longitude_deg = place(north_m, east_m)
    values = {
        "latitude_deg": latitude_deg,
        "longitude_deg": longitude_deg,
        "relative_altitude_m": 8.0,
        "speed_m_s": 5.0,
        "is_fly_through": True,
        "acceptance_radius_m": 1.0,
        **fields,
    }
    return MissionItem(**values)


@pytest.mark.promise
def test_a_mission_is_flown_paused_changed_and_finished(client: Client) -> None:
    pilot, mission = client.pilot, client.mission
    seen: list[Any] = []
    handle = mission.subscribe_mission_progress(lambda p, _user_data=None: seen.append(p))
    items = [
        waypoint(0.0, EAST_M, vehicle_action=MissionItem.VehicleAction.TAKEOFF),
        waypoint(20.0, EAST_M),
        waypoint(20.0, EAST_M + 15.0, is_fly_through=False, loiter_time_s=1.0),
        waypoint(0.0, EAST_M + 15.0),
    ]
    mission.set_return_to_launch_after_mission(True)
    mission.upload_mission(MissionPlan(items))
    down = mission.download_mission().mission_items
    assert [round(i.latitude_deg, 7) for i in down] == [round(i.latitude_deg, 7) for i in items]
    assert [i.speed_m_s for i in down] == [5.0] * 4
    assert not mission.is_mission_finished()
    pilot.action.arm()
    mission.start_mission()
    wait_for(lambda: pilot.distance_m(20.0, EAST_M) < 12.0, "the way to the second item")
    mission.pause_mission()
    wait_for(lambda: pilot.mode is FlightMode.HOLD, "the pause")
    wait_for(lambda: pilot.speed_m_s < 0.5, "the stop")
    mission.set_current_mission_item(3)
    mission.start_mission()
    wait_for(mission.is_mission_finished, "the end of the mission")
    wait_for(lambda: not pilot.telemetry.armed(), "the landing at home")
    mission.unsubscribe_mission_progress(handle)
    assert {p.total for p in seen} == {4}
    assert [p.current for p in seen] == sorted(p.current for p in seen)
    assert seen[-1].current == 4
    mission.clear_mission()
    assert client.raw.download_mission() == []


def test_a_fence_of_polygons_and_circles_comes_back(client: Client) -> None:
    corners = [Point(*place(north, east)) for north, east in ((-80, -80), (80, -80), (0, 120))]
    hole = [Point(*place(north, east)) for north, east in ((40, 0), (50, 0), (45, 10))]
    circle = Circle(Point(*place(0.0, EAST_M)), 60.0, FenceType.INCLUSION)
    polygons = [Polygon(corners, FenceType.INCLUSION), Polygon(hole, FenceType.EXCLUSION)]
    client.geofence.upload_geofence(GeofenceData(polygons, [circle]))
    down = client.geofence.download_geofence()
    assert [(len(p.points), FenceType(p.fence_type)) for p in down.polygons] == [
        (3, FenceType.INCLUSION),
        (3, FenceType.EXCLUSION),
    ]
    for sent, came in zip(corners, down.polygons[0].points, strict=True):
        assert came.latitude_deg == pytest.approx(sent.latitude_deg, abs=2e-7)
        assert came.longitude_deg == pytest.approx(sent.longitude_deg, abs=2e-7)
    assert [(c.radius, FenceType(c.fence_type)) for c in down.circles] == [
        (60.0, FenceType.INCLUSION)
    ]
    client.geofence.clear_geofence()
    assert client.raw.download_geofence() == []


def plan_of_qgroundcontrol() -> dict[str, Any]:
    """A plan as QGroundControl saves it: mission, fence and rally point."""

    def simple(jump: int, command: int, params: list[float | None], frame: int = 3) -> Any:
        return {
            "type": "SimpleItem",
            "autoContinue": True,
            "command": command,
            "doJumpId": jump,
            "frame": frame,
            "params": params,
            "AMSLAltAboveTerrain": None,
            "Altitude": 8,
            "AltitudeMode": 1,
        }

    north = place(20.0, EAST_M)
    items = [
        simple(1, TAKEOFF, [0, 0, 0, None, *place(0.0, EAST_M), 8]),
        simple(2, WAYPOINT, [0, 0, 0, None, *north, 8]),
        simple(3, RETURN, [0, 0, 0, 0, 0, 0, 0], frame=2),
    ]
    return {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {
            "version": 2,
            "firmwareType": 12,
            "vehicleType": 2,
            "cruiseSpeed": 15,
            "hoverSpeed": 5,
            "globalPlanAltitudeMode": 1,
            "plannedHomePosition": [*place(0.0, EAST_M), ALTITUDE_AMSL_M],
            "items": items,
        },
        "geoFence": {
            "version": 2,
            "polygons": [],
            "circles": [
                {
                    "version": 1,
                    "inclusion": True,
                    "circle": {"center": list(place(0.0, EAST_M)), "radius": 100},
                }
            ],
        },
        "rallyPoints": {"version": 2, "points": [[*place(5.0, EAST_M), 15]]},
    }


def test_a_plan_of_qgroundcontrol_is_imported_and_comes_back(
    client: Client, tmp_path: Path
) -> None:
    path = tmp_path / "field.plan"
    path.write_text(json.dumps(plan_of_qgroundcontrol()))
    raw = client.raw
    plan = raw.import_qgroundcontrol_mission(str(path))
    assert (len(plan.mission_items), len(plan.geofence_items), len(plan.rally_items)) == (3, 1, 1)
    raw.upload_geofence(plan.geofence_items)
    raw.upload_rally_points(plan.rally_items)
    raw.upload_mission(plan.mission_items)
    assert as_text(raw.download_mission()) == as_text(plan.mission_items)
    (fence,) = raw.download_geofence()
    (circle,) = plan.geofence_items
    assert (fence.command, fence.param1, fence.x, fence.y) == (
        circle.command,
        circle.param1,
        circle.x,
        circle.y,
    )
    (point,) = raw.download_rallypoints()
    assert (point.command, point.z) == (RALLY, 15.0)
    raw.clear_mission()
    client.geofence.clear_geofence()


@contextmanager
def reporting_position(client: Client, north_m: float, east_m: float) -> Iterator[None]:
    """Send where the target is, some times a second.

    MAVSDK takes the heartbeat of any component for the vehicle's, so that the camera's makes it
    believe for a moment that the vehicle does not follow: it then refuses, and sends nothing.
    """
    done = threading.Event()
    location = TargetLocation(*place(north_m, east_m), ALTITUDE_AMSL_M, 0.0, 0.0, 0.0)

    def report() -> None:
        while not done.wait(0.1):
            with suppress(FollowMeError):
                client.follow_me.set_target_location(location)

    thread = threading.Thread(target=report)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def test_a_target_is_followed_at_its_distance(client: Client) -> None:
    pilot, follow = client.pilot, client.follow_me
    follow.set_config(Config(FOLLOWING_M, FOLLOWING_M, 0.1, follow_angle_deg=180.0))
    assert follow.get_config().follow_distance_m == FOLLOWING_M
    pilot.take_off()
    follow.start()
    wait_for(lambda: pilot.mode is FlightMode.FOLLOW_ME, "follow me")
    target = (30.0, EAST_M)
    with reporting_position(client, *target):
        wait_for(lambda: abs(pilot.distance_m(*target) - FOLLOWING_M) < 2.0, "the distance")
        away = pilot.watch(5.0, lambda: pilot.distance_m(*target))
    assert max(abs(distance - FOLLOWING_M) for distance in away) < 3.0
    assert pilot.height_m == pytest.approx(8.0, abs=1.5)
    pilot.action.hold()
    wait_for(lambda: pilot.mode is FlightMode.HOLD, "hold")
    pilot.land()
