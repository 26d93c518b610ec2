"""The whole flight stack on JSBSim, as a vehicle of a simulated farm."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from afarcloud.enumerations import Status
from dst.simulate import simulate
from dst.vehicles.autopilot import Mode
from dst.vehicles.flight_stack import FlightStack
from dst.world.edge_process import prepared_folder
from dst.world.world import World
from tests.unit.dst.world.test_world import post, status, times_flown

pytestmark = [
    pytest.mark.thorough,  # A second of flight takes some 20 ms of a core
    pytest.mark.timeout(1200),
]


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return prepared_folder(tmp_path_factory.mktemp("prepared") / "state")


@pytest.fixture
def world(prepared: Path, tmp_path: Path) -> Iterator[World]:
    world = World(1, prepared, tmp_path, is_deep=True)
    yield world
    world.close()


def flying(world: World) -> FlightStack:
    """Fly a plan, until the vehicle is on its way."""
    world.run(15.0)
    post(world)
    vehicle = world.vehicles[1]
    assert isinstance(vehicle, FlightStack)
    while vehicle.truth.height_m < 4.0:
        assert world.scheduler.now_s < 60.0
        world.run(1.0)
    return vehicle


def test_a_plan_is_flown_and_reported(world: World) -> None:
    vehicle = flying(world)
    world.run(120.0)
    assert status(world, 1) == Status.FINISHED
    assert times_flown(world) == 1
    assert not vehicle.armed
    assert vehicle.truth.height_m < 0.3
    assert vehicle.parameters == vehicle.autopilot.parameters


def test_a_pilot_takes_over_and_lands(world: World) -> None:
    vehicle = flying(world)
    vehicle.take_over()
    world.run(10.0)
    assert vehicle.mode is Mode.PILOT
    assert vehicle.truth.height_m > 2.0
    vehicle.release()
    world.run(30.0)
    assert vehicle.truth.height_m < 0.3
    assert not vehicle.armed
    assert vehicle.truth.orders_under_pilot == []
    assert status(world, 1) in {Status.ABORTED, Status.FAILED}


def test_a_restarted_vehicle_stands_at_home(world: World) -> None:
    vehicle = flying(world)
    vehicle.reboot()
    world.run(1.0)
    assert not vehicle.is_flying
    assert not vehicle.armed
    assert vehicle.booted_at_s > 0.0


def test_a_motor_that_fails_is_noted(world: World) -> None:
    vehicle = flying(world)
    vehicle.fail(lands=False)
    assert vehicle.truth.motor_failures_s == [world.scheduler.now_s]
    world.run(20.0)
    assert vehicle.truth.height_m < 0.3


def test_the_same_seed_gives_the_same_trace(prepared: Path) -> None:
    outcomes = [simulate(2, prepared, is_deep=True) for _ in range(2)]
    assert outcomes[0].digest == outcomes[1].digest
    assert outcomes[0].flight_s > 0.0
