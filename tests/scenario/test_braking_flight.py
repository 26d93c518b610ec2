"""Fast flights that a stop ends: by an operator's HOLD, or by the geofence; the truth judges."""

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.autopilot_tester import AutopilotTester, hovering_tester
from tests.support.stick_pilot import StickPilot, change_mode
from uav_firmware.msg.status import NavigationState

pytestmark = pytest.mark.scenario

POSITION, STABILIZED = 3, 7
LOITER, RETURN, LAND = (4, 3), (4, 5), (4, 6)


def hovering(folder: Path, **settings: float) -> tuple[AutopilotTester, StickPilot]:
    """A vehicle at rest 10 m up, and a pilot with centred sticks."""
    tester = hovering_tester(folder, 1, 10.0)
    tester.run_for(3.0)
    for name, value in settings.items():
        tester.autopilot.registry.set(name, value)
    pilot = StickPilot(tester)
    tester.run_for(0.5)
    return tester, pilot


def record(tester: AutopilotTester, value: Callable[[], float]) -> list[float]:
    """What a value is from now on."""
    values: list[float] = []
    tester.watch(lambda: values.append(value()))
    return values


def climb_rate(tester: AutopilotTester) -> float:
    """True, [m/s]."""
    return -tester.truth.velocity_ned[2]


def rises_again(speeds: list[float]) -> float:
    """By how much a speed grows again, once it has fallen below half of what it was."""
    slow = itertools.dropwhile(lambda speed: speed > 0.5 * max(speeds), speeds)
    least, most = math.inf, 0.0
    for speed in slow:
        least = min(least, max(speed, 0.0))
        most = max(most, speed - least)
    return most


@pytest.mark.parametrize("mode", [LOITER, LAND], ids=["hold", "land"])
def test_a_fast_climb_ends_where_the_vehicle_can_stop(
    tmp_path: Path, mode: tuple[int, int]
) -> None:
    tester, pilot = hovering(tmp_path)
    change_mode(tester, STABILIZED)
    pilot.move(up=1.0)
    tester.wait_until(lambda: climb_rate(tester) > 9.0, 10.0, "climbing at 9 m/s")
    ordered = tester.true_position()[2]
    change_mode(tester, *mode)
    pilot.move()
    speeds = record(tester, lambda: climb_rate(tester))
    heights = record(tester, lambda: tester.true_position()[2])
    tester.run_for(10.0)
    # 3 m/s^2 down to the controller's 3 m/s would take 12 m more than gravity does.
    assert max(heights) - ordered < 10.0
    assert rises_again(speeds) < 0.4


@pytest.mark.parametrize("mode", [LOITER, LAND], ids=["hold", "land"])
def test_a_fast_level_flight_ends_where_the_vehicle_can_stop(
    tmp_path: Path, mode: tuple[int, int]
) -> None:
    tester, pilot = hovering(tmp_path, MPC_MAN_TILT_MAX=50.0)
    change_mode(tester, 2)
    pilot.move(forward=1.0)
    tester.wait_until(lambda: math.hypot(*tester.truth.velocity_ned[:2]) > 12.0, 20.0, "at 12 m/s")
    ordered = tester.true_position()[0]
    change_mode(tester, *mode)
    pilot.move()
    speeds = record(tester, lambda: tester.truth.velocity_ned[0])
    ways = record(tester, lambda: tester.true_position()[0] - ordered)
    tester.run_for(10.0)
    assert max(ways) < 20.0
    assert rises_again(speeds) < 0.4


@pytest.mark.parametrize(
    ("action", "mode"),
    [
        (2, NavigationState.AUTO_LOITER),
        (3, NavigationState.AUTO_RTL),
        (5, NavigationState.AUTO_LAND),
    ],
)
def test_a_climb_at_full_thrust_ends_below_the_ceiling(
    tmp_path: Path, action: int, mode: NavigationState
) -> None:
    tester, pilot = hovering(tmp_path, GF_MAX_VER_DIST=30.0, GF_ACTION=action)
    heights = record(tester, lambda: tester.true_position()[2])
    change_mode(tester, STABILIZED)
    pilot.move(up=1.0)
    tester.wait_until(lambda: tester.mode is mode, 5.0, "stopped by the geofence")
    tester.run_for(15.0)
    assert max(heights) < 30.0
