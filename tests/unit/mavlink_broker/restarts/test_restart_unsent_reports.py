"""A broker that is restarted before it could send its reports; simulated time.

Until they arrive the edge server has the statuses of before the outage.
"""

import dataclasses
import functools
from collections import Counter
from pathlib import Path

import pytest

from afarcloud.enumerations import EventType, Status
from mavlink_broker.mavlink.dialect import mavlink
from tests.soak.broker_death import Undisturbed, judge_orders, judge_reports, scripted, sorties
from tests.support.broker_world import World, first_flight, mission
from tests.support.unreachable_edge import UnreachableEdge
from tests.support.vehicle_script import PX4

ITEM_S = 4.0
NUMBER = 1201


def world_with(folder: Path, *, sends_before_it_asks: bool = True) -> World:
    world = World()
    world.edge = UnreachableEdge(
        folder, world.clock.monotonic, sends_before_it_asks=sends_before_it_asks
    )
    world.start_broker()
    world.add_vehicle(script=dataclasses.replace(PX4, item_time_s=ITEM_S))
    return world


def edge_of(world: World) -> UnreachableEdge:
    assert isinstance(world.edge, UnreachableEdge)
    return world.edge


def die(world: World, *, outage_s: float, edge_is_back: bool) -> None:
    """Kill the broker while the edge server is away; that is back before it, or after it."""
    world.kill_broker()
    world.run(outage_s)
    edge = edge_of(world)
    edge.lose_broker()
    edge.is_unreachable = not edge_is_back
    world.restart_broker()
    if not edge_is_back:
        world.run(7.0)
        edge.is_unreachable = False


def fly(world: World, gone_at_s: float, dies_at_s: float, *, edge_is_back: bool) -> None:
    """Fly two equal sorties; the edge server goes, then the broker."""
    world.edge.plan(mission(*sorties()))
    world.run(gone_at_s)
    edge_of(world).is_unreachable = True
    world.run(dies_at_s - gone_at_s)
    die(world, outage_s=2.0, edge_is_back=edge_is_back)
    world.run_until_over(NUMBER, 300.0)


@functools.cache
def undisturbed() -> Undisturbed:
    """The same flight without an outage."""
    world, _ = scripted(sorties(), PX4, None)
    vehicle = world.only_vehicle
    return Undisturbed(0.0, Counter(vehicle.commands), vehicle.uploads)


def judge(world: World) -> None:
    """Everything was ordered once, reported once and in order."""
    judge_reports(world.edge, mission(*sorties()))
    vehicle = world.only_vehicle
    judge_orders(Counter(vehicle.commands), vehicle.uploads, undisturbed(), "RUNNING")


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("gone_at_s", "dies_at_s", "edge_is_back"),
    [(2.0, 21.0, True), (24.0, 60.0, False)],
)
def test_nothing_is_flown_twice_and_no_status_goes_back(
    gone_at_s: float, dies_at_s: float, edge_is_back: bool, tmp_path: Path
) -> None:
    world = world_with(tmp_path)
    fly(world, gone_at_s, dies_at_s, edge_is_back=edge_is_back)
    judge(world)


@pytest.mark.thorough
def test_that_is_so_because_reports_are_sent_before_work_is_taken(tmp_path: Path) -> None:
    world = world_with(tmp_path, sends_before_it_asks=False)
    fly(world, 2.0, 21.0, edge_is_back=True)
    with pytest.raises(AssertionError):
        judge(world)


@pytest.mark.thorough
def test_a_mission_that_ended_unreported_is_not_attached_again(tmp_path: Path) -> None:
    world = world_with(tmp_path)
    world.edge.plan(first_flight())
    world.run_until(lambda: world.edge.status(NUMBER) == Status.RUNNING)
    edge_of(world).is_unreachable = True
    world.run_until(lambda: world.only_vehicle.mission_state == mavlink.MISSION_STATE_COMPLETE)
    world.run(10.0)
    die(world, outage_s=1.0, edge_is_back=True)
    world.run(20.0)
    assert world.edge.statuses(NUMBER) == [Status.FINISHED] * 3
    assert [r["mission_status_id"] for r in world.edge.reports(NUMBER)].count(Status.FINISHED) == 1
    assert world.only_vehicle.uploads == 1


def test_an_abort_that_was_carried_out_unreported_is_not_repeated(tmp_path: Path) -> None:
    world = world_with(tmp_path)
    world.edge.plan(first_flight())
    world.run_until(lambda: world.edge.status(NUMBER) == Status.RUNNING)
    world.run(3.0)
    event = world.edge.event(EventType.ABORT_MISSION)
    world.tick()
    edge_of(world).is_unreachable = True
    world.run_until(lambda: not world.only_vehicle.armed)
    world.run(5.0)
    orders = list(world.only_vehicle.commands)
    die(world, outage_s=1.0, edge_is_back=True)
    world.run(20.0)
    assert [a["status"] for a in world.edge.acknowledgements(event)] == ["accepted", "done"]
    assert world.edge.status(NUMBER) == Status.ABORTED
    ordered = Counter(world.only_vehicle.commands) - Counter(orders)
    assert not {mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_DO_SET_MODE} & set(ordered)
