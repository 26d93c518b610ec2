"""Each law is broken on purpose in a world that keeps it otherwise."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dst.actors.operator_person import PAUSE, Operator, PostedAbort, PostedPause, PostedPlan
from dst.actors.plans import PlannedCommands
from dst.laws.facts import LawError
from dst.laws.mission_laws import EXPIRY_S
from dst.laws.system_laws import Laws
from dst.vehicles.autopilot import Mode
from dst.vehicles.flight import Arming, OrderUnderPilot, Reached, Truth
from dst.vehicles.vehicle import Vehicle
from dst.world.edge_process import prepared_folder
from dst.world.world import World
from mavlink_broker.edge.bounded_http import Answer
from mavlink_broker.edge.outbox import Post, Urgency
from tests.unit.dst.world.test_world import plan


class Farm:
    """A world in which the operator's first plan has been flown."""

    def __init__(self, folder: Path) -> None:
        self.world = World(2, prepared_folder(folder / "prepared"), folder)
        self.operator = Operator(self.world, ())
        self.laws = Laws(self.world, self.operator)
        while not self.operator.plans:
            self.world.run(10.0)
        self.operator.stop()
        self.world.run(20.0)
        while self.laws.open_matters():
            assert self.world.scheduler.now_s < 1200.0
            self.world.run(20.0)


@pytest.fixture(scope="module")
def farm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Farm]:
    farm = Farm(tmp_path_factory.mktemp("farm"))
    yield farm
    farm.world.close()


def test_a_world_without_faults_keeps_every_law(farm: Farm) -> None:
    farm.laws.check_end()
    assert farm.world.vehicles[1].truth.reached


def test_a_record_that_the_cloud_lacks_is_found(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    received = farm.world.cloud.received
    kept = {i: one for i, one in received.items() if one.stream.kind != "mission_report"}
    monkeypatch.setattr(farm.world.cloud, "received", kept)
    with pytest.raises(LawError, match=r"the cloud lacks .* of mission_report"):
        farm.laws.check_end()


def test_a_record_under_two_ids_is_found(farm: Farm, monkeypatch: pytest.MonkeyPatch) -> None:
    received = farm.world.cloud.received
    monkeypatch.setattr(
        farm.world.cloud, "received", {**received, "another": next(iter(received.values()))}
    )
    with pytest.raises(LawError, match="under 2 ids"):
        farm.laws.check_end()


def test_records_of_a_stream_in_another_order_are_found(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    received = dict(reversed(farm.world.cloud.received.items()))
    monkeypatch.setattr(farm.world.cloud, "received", received)
    with pytest.raises(LawError, match="after"):
        farm.laws.check_end()


def test_a_vehicle_that_stays_armed_is_an_open_matter(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(farm.world.vehicles[1], "armed", True)
    assert farm.laws.open_matters() == ["vehicle 1 is armed"]


def test_a_finished_waypoint_that_was_not_flown_is_found(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(farm.world.vehicles[1].truth, "reached", [])
    with pytest.raises(LawError, match="FINISHED and was not flown"):
        farm.laws.check_end()


def test_what_any_aircraft_with_the_system_id_has_flown_counts(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    truth, another = farm.world.vehicles[1].truth, Truth()
    monkeypatch.setattr(farm.world, "truths", lambda _system: [truth, another])
    reached = truth.reached
    monkeypatch.setattr(another, "reached", reached)
    monkeypatch.setattr(truth, "reached", [])
    farm.laws.check_end()
    again = [one._replace(time_s=farm.world.scheduler.now_s + 60.0) for one in reached]
    monkeypatch.setattr(another, "reached", [*reached, *again])
    with pytest.raises(LawError, match="though it ended"):
        farm.laws.check()


def test_a_waypoint_that_is_flown_after_the_end_is_found(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    truth = farm.world.vehicles[1].truth
    again = [one._replace(time_s=farm.world.scheduler.now_s + 60.0) for one in truth.reached]
    monkeypatch.setattr(truth, "reached", [*truth.reached, *again])
    with pytest.raises(LawError, match="though it ended"):
        farm.laws.check()


def test_a_vehicle_that_is_armed_for_an_expired_plan_is_found(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = farm.operator.plans[0]
    monkeypatch.setattr(plan, "expires_s", plan.posted_s - 10.0)
    with pytest.raises(LawError, match=r"was armed for it at .* though it expired"):
        farm.laws.check_end()


def test_an_arming_for_another_plan_does_not_begin_an_expired_one(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, truth = farm.operator.plans[0], farm.world.vehicles[1].truth
    [arming] = truth.armings
    assert arming.places_e7 == set(plan.commands.waypoints.values())
    monkeypatch.setattr(plan, "expires_s", arming.time_s - EXPIRY_S - 0.1)
    for_another = Arming(plan.posted_s, frozenset({(404_000_000, -37_000_000)}))
    monkeypatch.setattr(truth, "armings", [for_another, arming])
    with pytest.raises(LawError, match=r"was armed for it at .* though it expired"):
        farm.laws.check()
    not_known = Arming(plan.posted_s)
    monkeypatch.setattr(truth, "armings", [not_known, arming])
    farm.laws.check()


def test_a_vehicle_that_is_armed_too_late_and_does_not_fly_is_found(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, truth = farm.operator.plans[0], farm.world.vehicles[1].truth
    places = frozenset(plan.commands.waypoints.values())
    monkeypatch.setattr(truth, "reached", [])
    monkeypatch.setattr(plan, "expires_s", plan.posted_s + 1.0)
    monkeypatch.setattr(truth, "armings", [Arming(plan.posted_s + 5.9, places)])
    farm.laws.check()
    monkeypatch.setattr(truth, "armings", [Arming(plan.posted_s + 6.1, places)])
    with pytest.raises(LawError, match=r"was armed for it at .* though it expired"):
        farm.laws.check()


def test_an_order_to_a_vehicle_that_a_pilot_flies_is_found(farm: Farm) -> None:
    order = OrderUnderPilot(100.0, 50.0, "MAV_CMD_NAV_LAND")
    farm.world.vehicles[1].truth.orders_under_pilot.append(order)
    with pytest.raises(LawError, match="MAV_CMD_NAV_LAND"):
        farm.laws.check()
    farm.world.vehicles[1].truth.orders_under_pilot.clear()


def abort_in_flight(farm: Farm, mission_id: int) -> PostedAbort:
    """Post a plan for vehicle 1, and abort it when it flies."""
    world = farm.world
    assert world.request("POST", "/plans/", plan(mission_id)).status == 201
    while not world.vehicles[1].is_flying:
        world.run(1.0)
    event = {"sequence_number": mission_id, "vehicle_id": 1, "event_type_id": 1}
    number = world.request("POST", "/events/", event).json()["id"]
    return PostedAbort(number, 1, world.scheduler.now_s, waits=False)


def test_a_waypoint_that_is_flown_after_an_abort_is_found(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(farm.operator, "aborts", [abort_in_flight(farm, 901)])
    farm.world.run(60.0)
    farm.laws.check()
    monkeypatch.setattr(
        farm.laws._missions, "_ended", {}
    )  # Of the law about missions that have ended
    truth = farm.world.vehicles[1].truth
    again = [one._replace(time_s=farm.world.scheduler.now_s + 5.0) for one in truth.reached]
    monkeypatch.setattr(truth, "reached", [*truth.reached, *again])
    with pytest.raises(LawError, match="though abort"):
        farm.laws.check()


def test_a_vehicle_that_flies_on_after_an_abort_is_found(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(farm.operator, "plans", [])
    monkeypatch.setattr(farm.operator, "aborts", [abort_in_flight(farm, 904)])
    farm.world.run(60.0)
    farm.laws.check()
    vehicle = farm.world.vehicles[1]
    monkeypatch.setattr(vehicle, "mode", Mode.FOLLOW)
    monkeypatch.setattr(vehicle.truth, "height_m", 5.0)
    with pytest.raises(LawError, match="flies on in FOLLOW, though abort"):
        farm.laws.check()


def test_an_abort_that_has_not_ended_is_an_open_matter(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    abort = abort_in_flight(farm, 902)
    monkeypatch.setattr(farm.operator, "aborts", [abort])
    assert f"abort {abort.number} is queued" in farm.laws.open_matters()
    farm.world.run(60.0)
    assert farm.laws.open_matters() == []


def test_a_parameter_that_is_not_given_back_is_an_open_matter(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle = farm.world.vehicles[1]
    name = next(iter(vehicle.parameters))
    monkeypatch.setitem(vehicle.parameters, name, 7.5)
    assert farm.laws.open_matters() == [f"vehicle 1 has borrowed ('{name}', 7.5)"]


def test_a_geofence_that_is_not_given_back_is_an_open_matter(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle = farm.world.vehicles[1]
    assert isinstance(vehicle, Vehicle)
    fence = mavlink.MAV_MISSION_TYPE_FENCE
    monkeypatch.setitem(vehicle._missions._plans, fence, [object()])
    assert farm.laws.open_matters() == ["vehicle 1 has a borrowed geofence"]


@pytest.mark.parametrize(
    ("fact", "value", "law"),
    [
        ("furthest_m", 61.0, "has left its fence: 61.0 m"),
        ("highest_m", 20.5, "up to 20.5 m"),
        ("hardest_m_s", 2.0, r"has come down at 2\.0 m/s"),
    ],
)
def test_a_flight_that_is_not_safe_is_found(
    farm: Farm, monkeypatch: pytest.MonkeyPatch, fact: str, value: float, law: str
) -> None:
    monkeypatch.setattr(farm.world.vehicles[1].truth, fact, value)
    with pytest.raises(LawError, match=law):
        farm.laws.check()


def test_a_report_that_a_killed_broker_had_to_keep_is_an_open_matter(farm: Farm) -> None:
    world, post = farm.world, report("key of a report")
    world.http.owed.note(post, Answer(503, b""))
    world.run(20.0)
    world.http.owed.broker_ends(world.http.is_lasting, disk_worked_s=60.0)
    [matter] = farm.laws.open_matters()
    assert matter.startswith("POST /mission_report/ is lost")
    world.http.owed.take(post, Answer(201, b"{}"))
    assert farm.laws.open_matters() == []


@pytest.mark.parametrize(
    ("after_s", "disk_worked_s"), [(5.0, 60.0), (20.0, 10.0)], ids=["just failed", "bad disk"]
)
def test_a_report_that_a_killed_broker_may_lose_is_no_open_matter(
    farm: Farm, after_s: float, disk_worked_s: float
) -> None:
    world = farm.world
    world.http.owed.note(report(f"key after {after_s}"), Answer(503, b""))
    world.run(after_s)
    world.http.owed.broker_ends(world.http.is_lasting, disk_worked_s=disk_worked_s)
    assert farm.laws.open_matters() == []


def report(key: str) -> Post:
    return Post(
        method="POST",
        path="/mission_report/",
        body={"mission_id": 1, "mission_status_id": 3},
        vehicle_id=1,
        lane="vehicle",
        urgency=Urgency.REPORT,
        idempotency_key=key,
    )


def test_a_motor_failure_without_an_alarm_is_found(farm: Farm) -> None:
    farm.world.run(20.0)
    farm.world.vehicles[1].truth.motor_failures_s.append(farm.world.scheduler.now_s)
    with pytest.raises(LawError, match="no alarm of the motor"):
        farm.world.run(60.0)
    farm.world.vehicles[1].truth.motor_failures_s.clear()


def test_a_report_that_the_edge_server_refuses_is_found(farm: Farm) -> None:
    post = Post(
        method="POST",
        path="/pose/",
        body={"latitude": 91.0},
        vehicle_id=1,
        lane="pose",
        urgency=Urgency.RESULT,
    )
    farm.world.http.on_taken(post, Answer(422, b"{}"))
    with pytest.raises(LawError, match=r"refuses /pose/ .*91"):
        farm.laws.check()
    farm.laws._invalid.clear()


def test_a_waypoint_that_is_flown_while_the_mission_is_paused_is_found(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = farm.world
    number = world.request("POST", "/plans/", plan(903)).json()["id"]
    waypoint = plan(903)["missions"][0]["command_array"][1]["parameters"]
    where = round(waypoint["latitude"] * 1e7), round(waypoint["longitude"] * 1e7)
    posted = PostedPlan(number, 903, 1, PlannedCommands({2: where}), posted_s=world.scheduler.now_s)
    while not world.vehicles[1].is_flying:
        world.run(1.0)
    event = {"sequence_number": 903, "vehicle_id": 1, "event_type_id": PAUSE}
    pause = PostedPause(
        world.request("POST", "/events/", event).json()["id"], 1, world.scheduler.now_s
    )
    monkeypatch.setattr(farm.operator, "plans", [posted])
    monkeypatch.setattr(farm.operator, "pauses", [pause])
    world.run(30.0)
    flown = Reached(world.scheduler.now_s, *where)
    monkeypatch.setattr(world.vehicles[1].truth, "reached", [flown])
    with pytest.raises(LawError, match="has paused it"):
        farm.laws.check()


def test_an_internal_error_of_a_program_is_found(farm: Farm) -> None:
    app = farm.world.broker.app
    assert app is not None
    app.internal_errors.record("vehicle 1", ValueError("not foreseen"), 0.0)
    with pytest.raises(LawError, match="1 internal errors of the broker"):
        farm.laws.check()
    app.internal_errors.count = 0
    post = Post(
        method="POST", path="/pose/", body={}, vehicle_id=1, lane="pose", urgency=Urgency.RESULT
    )
    farm.world.http.on_taken(post, Answer(500, b"{}"))
    with pytest.raises(LawError, match="internal error of the edge server: POST /pose/"):
        farm.laws.check()
    farm.laws._unforeseen.clear()


def test_a_database_that_was_set_aside_is_found(farm: Farm) -> None:
    quarantine = farm.world.edge.config.database_path.parent / "quarantine"
    quarantine.mkdir()
    (quarantine / "edge-20261121T080000.db").touch()
    with pytest.raises(LawError, match="a database was set aside"):
        farm.laws.check()
    (quarantine / "edge-20261121T080000.db").unlink()
