import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import Status
from dst.actors.plans import FIELDS, GEOFENCE, HOTPOINT
from dst.vehicles.autopilot import FAMILIES, Autopilot
from dst.vehicles.flight import place
from dst.vehicles.vehicle import Vehicle
from dst.world.edge_process import prepared_folder
from dst.world.world import World
from edge_server.store.files import ballast


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return prepared_folder(tmp_path_factory.mktemp("prepared") / "state")


@pytest.fixture
def world(prepared: Path, tmp_path: Path) -> Iterator[World]:
    world = World(1, prepared, tmp_path)
    yield world
    world.close()


def plan(mission_id: int = 1, north_m: float = 30.0) -> dict[str, Any]:
    home, there = place(0.0, 0.0), place(north_m, 0.0)
    takeoff = {"latitude": home[0], "longitude": home[1], "altitude": 5.0}
    waypoint = {"latitude": there[0], "longitude": there[1], "altitude": 5.0}
    commands = [
        {"command_id": 1, "command_type_id": 1, "parameters": takeoff},
        {"command_id": 2, "command_type_id": 3, "parameters": waypoint},
        {"command_id": 3, "command_type_id": 11, "parameters": {"landing": True}},
    ]
    mission = {"mission_id": mission_id, "vehicle_id": 1, "maximum_speed": 4.0}
    return {"name": "test", "missions": [mission | {"command_array": commands}]}


def status(world: World, plan_id: int) -> int:
    [mission] = world.request("GET", f"/plans/{plan_id}").json()["missions"]
    return int(mission["mission_status_id"])


def run_until_finished(world: World, plan_id: int, within_s: float = 200.0) -> None:
    """Run until a plan's mission has finished, and the vehicle has reported it."""
    end_s = world.scheduler.now_s + within_s
    while status(world, plan_id) != Status.FINISHED:
        assert world.scheduler.now_s < end_s, status(world, plan_id)
        world.run(2.0)
    world.run(10.0)


def times_flown(world: World) -> int:
    waypoint = round(place(30.0, 0.0)[0] * 1e7)
    return sum(abs(one.latitude_e7 - waypoint) < 2 for one in world.vehicles[1].truth.reached)


def post(world: World) -> int:
    response = world.request("POST", "/plans/", plan())
    assert response.status == 201, response.body
    return int(response.json()["id"])


def test_a_plan_is_flown_and_reported_to_the_cloud(world: World) -> None:
    world.run(10.0)
    number = post(world)
    run_until_finished(world, number)
    assert times_flown(world) == 1
    assert not world.vehicles[1].armed
    kinds = {record.stream.kind for record in world.cloud.received.values()}
    assert "mission_report" in kinds


@pytest.mark.first_case
@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_each_family_flies_an_orbit_and_gets_its_parameters_back(
    family: Autopilot, prepared: Path, tmp_path: Path
) -> None:
    world = World(1, prepared, tmp_path, families=[family])
    world.run(10.0)
    body, centre = plan(), place(20.0, 0.0)
    where = {"latitude": centre[0], "longitude": centre[1]}
    orbit = {"command_id": 2, "command_type_id": HOTPOINT, "parameters": where | FIELDS[HOTPOINT]}
    body["missions"][0]["command_array"][1] = orbit
    number = world.request("POST", "/plans/", body).json()["id"]
    run_until_finished(world, number)
    [turned_rad] = world.vehicles[1].truth.turned_rad.values()
    assert turned_rad == pytest.approx(math.tau, rel=0.1)
    assert world.vehicles[1].parameters == family.parameters
    world.close()


def flies_or_is_fenced(vehicle: Vehicle) -> bool:
    return vehicle.is_flying or vehicle.has_fence


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_each_family_keeps_a_geofence_while_it_flies_and_gets_its_own_back(
    family: Autopilot, prepared: Path, tmp_path: Path
) -> None:
    world = World(1, prepared, tmp_path, families=[family])
    world.run(10.0)
    assert world.request("POST", "/plans/", plan() | {"geofence": GEOFENCE}).status == 201
    vehicle = world.vehicles[1]
    assert isinstance(vehicle, Vehicle)
    while not vehicle.is_flying:
        world.run(1.0)
    assert vehicle.has_fence
    assert vehicle.parameters != family.parameters
    while flies_or_is_fenced(vehicle):
        assert world.scheduler.now_s < 200.0
        world.run(2.0)
    world.run(5.0)
    assert [vehicle.has_fence, vehicle.parameters] == [False, family.parameters]
    world.close()


def test_another_aircraft_in_the_place_of_one_flies_the_next_plan(world: World) -> None:
    world.run(10.0)
    run_until_finished(world, post(world))
    vehicle = world.vehicles[1]
    assert isinstance(vehicle, Vehicle)
    vehicle.switch_off()
    world.run(30.0)
    vehicle.swap()
    world.run(10.0)
    number = world.request("POST", "/plans/", plan(2)).json()["id"]
    run_until_finished(world, number)
    assert times_flown(world) == 2


def test_another_aircraft_with_the_system_id_of_one_stays_where_it_is(world: World) -> None:
    world.run(10.0)
    world.add_twin(1)
    world.run(5.0)
    number = post(world)
    world.run(30.0)
    world.remove_twin(1)
    run_until_finished(world, number)
    assert times_flown(world) == 1
    assert not world.twins[1].is_flying


def test_a_plan_survives_a_loss_of_power_in_the_middle_of_commits(world: World) -> None:
    world.run(10.0)
    number = post(world)
    world.edge_machine.lose_power(after_changes=5)
    world.run(10.0)
    world.broker_machine.lose_power()
    processes = (world.edge, world.relay, world.broker)
    assert [process.is_up for process in processes] == [False] * 3
    for process in processes:
        process.start()
    assert status(world, number) in {Status.NOT_STARTED, Status.RUNNING}


def test_an_edge_server_is_started_again_until_its_disk_can_be_used(world: World) -> None:
    world.run(10.0)
    world.edge.kill()
    world.relay.kill()
    world.edge_machine.disk.lose_power()
    world.edge.start()
    world.run(5.0)
    was_up = world.edge.is_up
    world.edge_machine.disk.restore_power()
    world.run(5.0)
    assert (was_up, world.edge.is_up) == (False, True)


def test_a_mission_survives_kills_of_every_process(world: World) -> None:
    world.run(10.0)
    number = post(world)
    world.run(12.0)
    for process in (world.broker, world.edge, world.relay):
        process.kill()
        world.run(3.0)
        process.start()
        world.run(3.0)
    run_until_finished(world, number)
    assert times_flown(world) == 1


def order(world: World, kind: int, number: int) -> str:
    """Post an event to the vehicle; gives its path."""
    event = {"sequence_number": number, "vehicle_id": 1, "event_type_id": kind}
    response = world.request("POST", "/events/", event)
    assert response.status == 201, response.body
    return f"/events/{response.json()['id']}"


def test_events_and_missions_end_while_a_full_edge_server_refuses_results(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The edge server has released its ballast, and there is no room for it again."""
    answers: list[tuple[str, int]] = []
    monkeypatch.setattr(
        world.http, "on_taken", lambda post, answer: answers.append((post.path, answer.status_code))
    )
    world.run(10.0)
    number = post(world)
    with monkeypatch.context() as full:
        full.setattr(ballast, "hold", lambda _path: False)
        world.edge.config.ballast_path.unlink()
        while ("/pose/", 507) not in answers:
            world.run(0.5)
            assert world.scheduler.now_s < 60.0
        paused = order(world, 101, 1)
        world.run(8.0)
        assert world.request("GET", paused).json()["state"] == "done"
        aborted = order(world, 1, 2)
        world.run(8.0)
        assert world.request("GET", aborted).json()["state"] == "done"
        assert status(world, number) == Status.ABORTED
        assert ("/pose/", 201) not in answers
        client = world.broker.client
        assert client is not None
        assert client.waiting > 0
    world.run(60.0)
    assert ("/pose/", 201) in answers
    assert ("/battery/", 201) in answers
    assert client.waiting <= 1


def test_a_plan_waits_for_a_vehicle_that_is_switched_off(world: World) -> None:
    world.run(10.0)
    world.switch_off()
    world.run(200.0)
    number = post(world)
    world.run(20.0)
    assert status(world, number) in {Status.NOT_STARTED, Status.RUNNING}
    world.switch_on()
    run_until_finished(world, number)
    assert times_flown(world) == 1


def test_a_battery_that_is_not_measured_is_shown_as_stale(world: World) -> None:
    world.run(10.0)
    assert world.request("GET", "/vehicles/1").json()["stale"] == []
    world.vehicles[1].knows_battery = False
    world.run(10.0)
    assert world.request("GET", "/vehicles/1").json()["stale"] == ["battery"]
    world.vehicles[1].knows_battery = True
    world.run(10.0)
    assert world.request("GET", "/vehicles/1").json()["stale"] == []


def test_the_same_seed_gives_the_same_trace_and_the_same_ids(
    prepared: Path, tmp_path: Path
) -> None:
    found = []
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        world = World(3, prepared, tmp_path / name)
        world.run(10.0)
        post(world)
        world.run(60.0)
        world.close()
        found.append((world.scheduler.trace.digest, list(world.cloud.received)))
    assert found[0] == found[1]
