"""A mission of a thousand items costs no control step more than a short one does.

Work is counted in calls of Python functions, which is the same on every machine.
"""

import sys
from types import FrameType

import pytest

from tests.support.toy_vehicle import ToyVehicle, item, takeoff, waypoint
from uav_firmware.msg.mission import MissionItem


def lanes(count: int, **fields: float) -> list[MissionItem]:
    """A meander of waypoints 4 m apart, flown through."""
    items = [takeoff()]
    for seq in range(1, count):
        lane, along = divmod(seq, 25)
        east = along if lane % 2 == 0 else 24 - along
        items.append(waypoint(seq, 4.0 * lane, 4.0 * east, **fields))
    return items


def most_calls(items: list[MissionItem], seconds: float, *, speed_change: bool = False) -> int:
    """Largest number of calls in one step of navigator and commander, from the start on."""
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    vehicle.upload(*items)
    vehicle.run_until(lambda v: v.navigator_status.value is not None)
    vehicle.run(2.0)
    vehicle.set_mode(4)
    vehicle.arm()
    calls = most = 0

    def count(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal calls
        calls += event == "call"

    for step in range(round(seconds / 0.004)):
        if speed_change and step % 500 == 499:
            vehicle.send(178, 1.0, 3.0 + step % 2)
        calls = 0
        sys.setprofile(count)
        vehicle.step()
        sys.setprofile(None)
        most = max(most, calls)
    assert vehicle.reached, "it has not begun"
    return most


@pytest.mark.first_case
@pytest.mark.parametrize("speed_change", [False, True])
def test_no_step_of_a_thousand_items_costs_more_than_one_of_fifty(*, speed_change: bool) -> None:
    short = most_calls(lanes(50), 12.0, speed_change=speed_change)
    long = most_calls(lanes(1000), 12.0, speed_change=speed_change)
    assert long < 1.3 * short


def test_a_route_that_is_built_piece_by_piece_is_flown_without_a_stop() -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    line = [takeoff(), *(waypoint(seq, 3.0 * seq, 0.0) for seq in range(1, 120))]
    line[60] = item(60, 178, param1=1.0, param2=4.0)
    vehicle.upload(*line)
    vehicle.run(2.0)
    vehicle.set_mode(4)
    vehicle.arm()
    vehicle.run_until(lambda v: v.position[0] > 20.0)
    slowest = {"before": 99.0, "behind": 99.0}
    fastest_behind = 0.0
    while vehicle.position[0] < 340.0:
        vehicle.step()
        speed = vehicle.velocity[0]
        part = "before" if vehicle.position[0] < 170.0 else "behind"
        slowest[part] = min(slowest[part], speed)
        if vehicle.position[0] > 200.0:
            fastest_behind = max(fastest_behind, speed)
    assert slowest["before"] > 4.5
    assert slowest["behind"] > 3.5
    assert fastest_behind < 4.3
    assert vehicle.reached[:100] == list(range(100))
