"""When faults begin and end, beside the hours in which nobody works."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from dst.faults.injection import Faults
from dst.faults.kinds import Fault
from dst.vehicles.vehicle import Vehicle
from dst.world.edge_process import prepared_folder
from dst.world.world import World

SEED = 4
NIGHT_S = 3600.0


@pytest.fixture
def world(tmp_path: Path) -> Iterator[World]:
    (tmp_path / "world").mkdir()
    made = World(SEED, prepared_folder(tmp_path / "prepared"), tmp_path / "world", vehicles=2)
    yield made
    made.close()


def test_no_aircraft_is_switched_on_while_nobody_works(world: World) -> None:
    """One that is being exchanged for another when the work ends arrives, and stays off."""
    Faults(world, {Fault.SWAPPED, Fault.TWICE})
    vehicles = [one for one in world.vehicles.values() if isinstance(one, Vehicle)]
    serials = [vehicle.serial for vehicle in vehicles]
    while all(vehicle.is_on for vehicle in vehicles):
        world.run(0.1)
    world.add_twin(1)
    world.switch_off()
    while world.scheduler.now_s < NIGHT_S:
        world.run(5.0)
        assert not any(twin.is_on for twin in world.twins.values())
    assert [vehicle.serial for vehicle in vehicles] != serials
    assert not any(vehicle.is_on for vehicle in vehicles)
    world.switch_on()
    world.run(10.0)
    assert all(vehicle.is_on for vehicle in vehicles)
