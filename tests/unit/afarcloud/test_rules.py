from datetime import UTC, datetime
from typing import Any

import pytest

from afarcloud import annex, rules, wire
from afarcloud.commands import NavWaypoint
from afarcloud.flyable import VehicleLimits
from afarcloud.plan import Plan
from tests.unit.afarcloud import documents

NOW = datetime(2026, 11, 21, 9, 0, tzinfo=UTC)
FLEET = {1: VehicleLimits(), 2: VehicleLimits()}


def verdict(
    document: dict[str, Any], fleet: dict[int, VehicleLimits] | None = None
) -> rules.Verdict:
    plan = wire.read(wire.Kind.PLAN, document)
    assert isinstance(plan, Plan)
    return rules.check(plan, FLEET if fleet is None else fleet, NOW)


def fault_paths(document: dict[str, Any]) -> list[str]:
    return [fault.path for fault in verdict(document).faults]


def takeoff_then(*commands: tuple[int, dict[str, Any]]) -> dict[str, Any]:
    return documents.mission_of((1, documents.PARAMETERS[1]), *commands)


def test_a_good_plan_has_neither_faults_nor_warnings() -> None:
    assert verdict(documents.plan()) == rules.Verdict((), ())


def test_an_unregistered_vehicle_is_named() -> None:
    faults = verdict(documents.plan(), {1: VehicleLimits()}).faults
    assert [f.path for f in faults] == ["missions.1.vehicle_id"]


def test_a_vehicle_flies_one_mission_of_a_plan() -> None:
    document = documents.plan()
    document["missions"][1]["vehicle_id"] = 1
    assert "missions.1.vehicle_id" in fault_paths(document)


def test_mission_ids_differ() -> None:
    document = documents.plan()
    document["missions"][1]["mission_id"] = 1201
    assert fault_paths(document) == ["missions.1.mission_id"]


def test_command_ids_differ_within_a_mission() -> None:
    document = documents.plan()
    document["missions"][0]["command_array"][3]["command_id"] = 1
    assert fault_paths(document) == ["missions.0.command_array.3.command_id"]


def test_a_plan_of_the_past_is_refused() -> None:
    document = documents.plan()
    document["expires_at"] = "2026-11-21T08:59:59Z"
    assert fault_paths(document) == ["expires_at"]


@pytest.mark.parametrize(
    "name",
    [
        *("line\nbreak", "tab\there", "\x00", "\x9b31m", "\u2028", "\x7f"),
        *("\u202egnp.exe", "a\u2066b", "left\u202a"),
        *(" ", "\u3000", "\u200b\u200d", "\ufeff ", "\u3164", "\xad", "\u200e\u200f\u061c"),
        *("\u180e", "\u17b4", "\uffa0", "\ufe0f", "\ufff9", "\U000e0001", "\ufffe", "\u0301"),
    ],
)
def test_a_name_that_cannot_be_shown_is_refused(name: str) -> None:
    assert fault_paths(documents.plan() | {"name": name}) == ["name"]


@pytest.mark.parametrize(
    "name", ["North 7", "Größe", "الحقل الشمالي", "北の畑", "👩\u200d🌾 field", "नि\u200dल", "-"]
)
def test_a_name_in_any_language_is_fine(name: str) -> None:
    assert fault_paths(documents.plan() | {"name": name}) == []


def test_the_vehicles_speed_limit_holds() -> None:
    document = documents.plan()
    document["missions"][0]["maximum_speed"] = 12.1
    assert fault_paths(document) == ["missions.0.maximum_speed"]


def test_an_orbit_may_not_be_faster_than_the_mission() -> None:
    orbit = {**documents.PARAMETERS[7], "radius": 50, "angular_velocity": 20}
    mission = takeoff_then((7, orbit), (11, {"landing": True}))
    assert fault_paths(mission) == ["missions.0.command_array.1.parameters.angular_velocity"]


def test_the_first_flying_command_is_a_takeoff() -> None:
    mission = documents.mission_of((4, documents.PARAMETERS[4]), (3, documents.PARAMETERS[3]))
    assert fault_paths(mission) == ["missions.0.command_array.1.command_type_id"]


@pytest.mark.parametrize(
    ("kind", "parameters"), [(2, documents.PARAMETERS[2]), (11, {}), (11, {"landing": False})]
)
def test_a_hovering_vehicle_may_be_landed_or_sent_home(
    kind: int, parameters: dict[str, Any]
) -> None:
    assert fault_paths(documents.mission_of((kind, parameters))) == []


def test_pictures_before_the_takeoff_are_fine() -> None:
    mission = documents.mission_of(
        (4, documents.PARAMETERS[4]), (1, documents.PARAMETERS[1]), (11, {})
    )
    assert verdict(mission) == rules.Verdict((), ())


def test_an_open_end_is_warned_of() -> None:
    outcome = verdict(takeoff_then((3, documents.PARAMETERS[3])))
    assert not outcome.faults
    assert [w.path for w in outcome.warnings] == ["missions.0.command_array"]


@pytest.mark.parametrize("longitude", [-3.7393, -3.7379])
def test_a_waypoint_outside_the_fence_is_named(longitude: float) -> None:
    document = documents.plan()
    document["missions"][0]["command_array"][1]["parameters"]["longitude"] = longitude
    assert fault_paths(document) == ["missions.0.command_array.1.parameters"]


def test_an_orbit_that_crosses_the_fence_is_named_though_its_centre_is_inside() -> None:
    document = documents.plan()
    orbit = document["missions"][1]["command_array"][1]["parameters"]
    orbit["longitude"] = -3.73915  # 4 m inside, radius 10 m
    assert fault_paths(document) == ["missions.1.command_array.1.parameters"]


def test_an_exclusion_keeps_orbits_out_that_only_touch_it() -> None:
    document = documents.plan()
    document["geofence"]["exclusion"] = [
        [[40.44335, -3.7388], [40.44345, -3.7388], [40.44345, -3.7387], [40.44335, -3.7387]]
    ]
    assert fault_paths(document) == ["missions.1.command_array.1.parameters"]


def test_a_rally_point_outside_the_fence_is_named() -> None:
    document = documents.plan()
    parameters = document["missions"][0]["command_array"][1]["parameters"]
    inside = {name: parameters[name] for name in ("latitude", "longitude", "altitude")}
    outside = inside | {"latitude": inside["latitude"] + 1.0}
    document["rally_points"] = [inside, outside, inside | {"altitude": 100.0}]
    assert fault_paths(document) == ["rally_points.1", "rally_points.2.altitude"]


def test_the_fences_ceiling_holds() -> None:
    document = documents.plan()
    document["geofence"]["max_altitude"] = 6.0
    assert fault_paths(document) == [
        "missions.1.command_array.0.parameters.altitude",
        "missions.1.command_array.1.parameters.orbit_altitude",
    ]


def annexed(*waypoint: tuple[str, float]) -> dict[str, Any]:
    parameters = {**documents.PARAMETERS[3], **dict(waypoint)}
    mission = takeoff_then((3, parameters), (11, {}))
    return {"profile": "annex", "missions": [mission]}


@pytest.mark.parametrize(
    ("name", "value"),
    [("altitude", 5.01), ("hold_time", 3.01), ("desired_yaw_angle", 181), ("acceptance_radius", 4)],
)
def test_the_annex_is_narrower(name: str, value: float) -> None:
    assert fault_paths(annexed((name, value))) == [f"missions.0.command_array.1.parameters.{name}"]


def test_the_annex_takes_100_commands_and_the_field_700() -> None:
    waypoints = [(3, documents.PARAMETERS[3])] * 99
    mission = takeoff_then(*waypoints)
    assert not fault_paths({"profile": "annex", "missions": [mission]})
    longer = takeoff_then(*waypoints, (3, documents.PARAMETERS[3]))
    assert fault_paths({"profile": "annex", "missions": [longer]}) == ["missions.0.command_array"]
    assert not fault_paths({"profile": "field", "missions": [longer]})


def test_the_annex_only_warns_of_a_missing_takeoff() -> None:
    mission = documents.mission_of((3, documents.PARAMETERS[3]), (11, {}))
    outcome = verdict({"profile": "annex", "missions": [mission]})
    assert not outcome.faults
    assert [w.path for w in outcome.warnings] == ["missions.0.command_array.0.command_type_id"]


def test_annex_hold_times_are_tens_of_seconds() -> None:
    plan = wire.read(wire.Kind.PLAN, annexed(("hold_time", 1.5)))
    assert isinstance(plan, Plan)
    waypoint = annex.in_seconds(plan.missions[0]).command_array[1]
    assert isinstance(waypoint, NavWaypoint)
    assert waypoint.parameters.hold_time == 15.0
