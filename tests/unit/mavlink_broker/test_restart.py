"""A broker that has just started, in the middle of what an earlier one began; simulated time."""

from afarcloud.enumerations import Status
from tests.support.broker_world import World, go_home, mission, takeoff, waypoint
from tests.unit.mavlink_broker.test_live_commands import OWN, follow, hotpoint, panorama


def test_a_mission_is_not_refused_by_what_the_vehicle_has_not_told_yet() -> None:
    """The panorama flies on this project's own vehicle, and not on any other behind a landing."""
    world = World()
    world.edge.plan(mission(takeoff(), go_home(2), panorama(3)))
    world.run(1.0)
    assert world.edge.status(1201) is None
    world.add_vehicle(script=OWN)
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)


def test_what_its_vehicle_cannot_fly_is_refused_once_it_is_known() -> None:
    world = World()
    world.edge.plan(mission(takeoff(), go_home(2), panorama(3)))
    world.run(1.0)
    vehicle = world.add_vehicle()
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.ABORTED, Status.ABORTED, Status.FAILED]
    assert vehicle.uploads == 0


def test_what_ended_meanwhile_is_told_with_its_place_and_battery() -> None:
    world = World()
    vehicle = world.add_vehicle(script=OWN)
    world.edge.plan(mission(takeoff(), hotpoint(start_point=4), waypoint(3), go_home(4)))
    world.run_until(lambda: vehicle.circle is not None)
    world.run(1.0)
    world.kill_broker()
    world.run_until(lambda: vehicle.circle is None)
    world.restart_broker()
    world.run_until_over(1201)
    assert len(world.edge.bodies("/pose/")) == len(world.edge.bodies("/battery/")) == 4


def test_a_time_that_lasts_is_counted_by_the_vehicles_clock_from_the_first_second() -> None:
    world = World()
    vehicle = world.add_vehicle(script=OWN)
    world.edge.plan(mission(takeoff(), follow(), go_home(3)))
    world.run_until(lambda: vehicle.targets > 0)
    world.run(1.0)
    world.restart_broker()
    world.run_until_over(1201, within_s=100.0)
    assert world.edge.status(1201) == Status.FINISHED
