"""A broker that has just started, in the middle of what an earlier one began; simulated time."""

from afarcloud.enumerations import Status
from tests.support.broker_world import World, go_home, mission, takeoff
from tests.unit.mavlink_broker.test_live_commands import OWN, panorama


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
