"""Pictures of a mission wait until the gimbal looks where they are to be taken."""

import pytest

from afarcloud.plan import Mission
from mavlink_broker.autopilots.families import ARDUPILOT, GENERIC, OWN, PX4, Family
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.planning.mission import FlightPlan, LiveCommand, translate
from tests.support.broker_world import follow, go_home, mission, takeoff, waypoint
from tests.support.translated_missions import HOME
from tests.unit.mavlink_broker.planning.aimed_pictures import SHOOT, Aim, image

POINT = mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW
DELAY = mavlink.MAV_CMD_NAV_DELAY
WAITING = pytest.mark.parametrize("family", [PX4, ARDUPILOT, GENERIC], ids=lambda one: one.name)


def waits_s(family: Family, *aims: Aim, refused: frozenset[int] = frozenset()) -> list[float]:
    """The delay between the gimbal's command and the picture, of each picture."""
    commands = [takeoff(1), waypoint(2)]
    commands += [image(number, aim) for number, aim in enumerate(aims, start=3)]
    plan = Mission.model_validate(mission(*commands, go_home(50)))
    (segment,) = translate(plan, family, HOME, refused=refused).segments
    assert isinstance(segment, FlightPlan)
    items = segment.items
    shots = [n for n, item in enumerate(items) if item.command in {SHOOT, 203}]
    return [
        items[n - 1].parameters[0] if items[n - 1].command == DELAY else 0.0
        for n in shots
        if items[n - 1].command in {DELAY, POINT, 205} or refused
    ]


@WAITING
def test_the_first_picture_waits_for_half_a_turn(family: Family) -> None:
    assert waits_s(family, (-90.0, None)) == [4.5]


@WAITING
def test_another_one_in_the_same_direction_does_not_wait(family: Family) -> None:
    assert waits_s(family, (-90.0, 10.0), (-90.0, 10.0), (-90.0, 10.0)) == [4.5, 0.0, 0.0]


@pytest.mark.parametrize(
    ("before", "then", "seconds"),
    [
        ((-90.0, None), (0.0, None), 2.5),
        ((-90.0, None), (-80.0, None), 1.0),
        ((0.0, 350.0), (0.0, 10.0), 1.0),
        ((-45.0, 0.0), (-45.0, 180.0), 4.5),
        ((-45.0, 0.0), (-90.0, 90.0), 2.5),
        ((-45.0, None), (-45.0, 0.0), 4.5),
    ],
)
def test_it_waits_as_long_as_a_slow_gimbal_turns(before: Aim, then: Aim, seconds: float) -> None:
    assert waits_s(PX4, before, then)[-1] == seconds


def test_the_camera_of_the_projects_vehicle_waits_by_itself() -> None:
    assert waits_s(OWN, (-90.0, None), (0.0, None)) == [0.0, 0.0]


def test_a_vehicle_without_a_gimbal_does_not_wait() -> None:
    refused = frozenset({POINT, mavlink.MAV_CMD_DO_MOUNT_CONTROL})
    assert waits_s(PX4, (-90.0, None), refused=refused) == [0.0]


def test_a_mount_of_the_older_kind_is_waited_for_too() -> None:
    assert waits_s(PX4, (-90.0, None), refused=frozenset({POINT})) == [4.5]


def live_waits_s(family: Family, *aims: Aim) -> list[list[float]]:
    """The delays of each alternative, of each picture behind a target that was followed."""
    commands = [takeoff(1), follow(2)]
    commands += [image(number, aim) for number, aim in enumerate(aims, start=3)]
    plan = Mission.model_validate(mission(*commands, go_home(50)))
    lives = [one for one in translate(plan, family, HOME).segments if isinstance(one, LiveCommand)]
    pictures = [one.action for one in lives if one.action.command == SHOOT]
    return [[sum(order.wait_s for order in orders) for orders in one.begin] for one in pictures]


@WAITING
def test_live_pictures_wait_too_but_not_where_there_is_no_gimbal(family: Family) -> None:
    waits = live_waits_s(family, (-90.0, None), (-90.0, None), (0.0, None))
    assert waits == [[4.5, 4.5, 0.0, 0.0], [0.0] * 4, [2.5, 2.5, 0.0, 0.0]]


def test_live_pictures_of_the_projects_camera_do_not_wait() -> None:
    assert live_waits_s(OWN, (-90.0, None)) == [[0.0] * 4]
