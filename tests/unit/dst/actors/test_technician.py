"""A technician sends again what was given up, and a report twice, with the effects of once."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from afarcloud.enumerations import Status
from dst.actors.technician import LATEST_REPETITION_S, LOOK_S, Technician
from dst.faults.kinds import Fault
from dst.world.edge_process import prepared_folder
from dst.world.world import World
from mavlink_broker.edge.spool import read_dead_letters
from tests.unit.dst.world.test_world import post, status


@pytest.fixture
def world(tmp_path: Path) -> Iterator[World]:
    world = World(1, prepared_folder(tmp_path / "prepared"), tmp_path)
    yield world
    world.close()


def lines_of(world: World) -> list[str]:
    return [line for line in world.scheduler.trace.lines if "technician >" in line]


@pytest.mark.thorough
def test_a_report_that_comes_twice_changes_nothing(world: World) -> None:
    world.http.on_answered = Technician(world, {Fault.REPEATED_POSTS}).note
    world.run(10.0)
    numbers = []
    while not lines_of(world):
        assert world.scheduler.now_s < 2000.0
        numbers.append(post(world))
        world.run(120.0 + LATEST_REPETITION_S)
    assert lines_of(world)[0].endswith("once more: 201")
    assert {status(world, number) for number in numbers} == {Status.FINISHED}


def test_a_dead_letter_is_sent_again_when_the_edge_server_takes_it(world: World) -> None:
    Technician(world, {Fault.REPORT_ALWAYS_FAILS})
    world.http.poison_rate = 1.0
    world.run(10.0)
    number = post(world)
    folder = world.broker_machine.disk.folder
    while not read_dead_letters(folder):
        assert world.scheduler.now_s < 2000.0
        world.run(5.0)
    world.http.restore()
    world.run(4.0 * LOOK_S)
    assert any("retry" in line for line in lines_of(world))
    assert status(world, number) == Status.FINISHED
