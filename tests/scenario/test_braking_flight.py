"""Fast flights that a stop ends: by an operator's HOLD, or by the geofence; the truth judges."""

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

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


def order_to(tester: AutopilotTester, command: int, *parameters: float, north: float) -> None:
    """A reposition or an orbit at 10 m above home; the vehicle must accept."""
    latitude, longitude, _ = tester.place(north, 0.0, 0.0)
    tester.send_command(
        command, *parameters, latitude, longitude, tester.start.altitude_amsl_m + 10.0
    )


def distance(tester: AutopilotTester) -> float:
    """True distance [m] from home."""
    return math.hypot(*tester.true_position()[:2])


def test_a_fast_flight_to_the_edge_of_the_fence_is_flown(tmp_path: Path) -> None:
    tester, _ = hovering(tmp_path, GF_MAX_HOR_DIST=50.0)
    distances = record(tester, lambda: distance(tester))
    values = (12.0, 1.0, 0.0, math.nan)
    order_to(tester, common.MAV_CMD_DO_REPOSITION, *values, north=49.5)
    tester.run_for(20.0)
    assert 49.0 < max(distances) < 50.0
    assert not tester.has_status_text("Geofence breached")


@pytest.mark.parametrize("at_m", [25.0, 35.0, 45.0])
def test_a_hold_on_the_flight_to_the_edge_of_the_fence_ends_inside(
    tmp_path: Path, at_m: float
) -> None:
    tester, _ = hovering(tmp_path, GF_MAX_HOR_DIST=50.0)
    distances = record(tester, lambda: distance(tester))
    values = (12.0, 1.0, 0.0, math.nan)
    order_to(tester, common.MAV_CMD_DO_REPOSITION, *values, north=49.5)
    tester.wait_until(lambda: distance(tester) > at_m, 20.0, f"at {at_m} m")
    change_mode(tester, *LOITER)
    tester.run_for(6.0)
    assert max(distances) < 50.0


def test_a_circle_along_the_fence_is_flown_and_a_hold_on_it_ends_inside(tmp_path: Path) -> None:
    tester, _ = hovering(tmp_path, GF_MAX_HOR_DIST=50.0)
    distances = record(tester, lambda: distance(tester))
    order_to(tester, common.MAV_CMD_DO_ORBIT, 49.0, 9.0, 0.0, 0.0, north=0.0)
    tester.run_for(40.0)
    assert not tester.has_status_text("Geofence breached")
    assert math.hypot(*tester.truth.velocity_ned[:2]) > 8.0
    change_mode(tester, *LOITER)
    tester.run_for(6.0)
    assert not tester.has_status_text("Geofence breached")
    assert max(distances) < 50.0


@pytest.mark.parametrize(
    ("settings", "sticks"),
    [
        ({}, {"forward": 1.0}),
        ({"MPC_VEL_MANUAL": 20.0, "MPC_XY_VEL_MAX": 20.0}, {"forward": 1.0}),
        ({"MPC_Z_VEL_MAX_UP": 8.0}, {"up": 1.0}),
    ],
    ids=["level", "fast", "climb"],
)
def test_a_pilot_is_stopped_inside_the_fence(
    tmp_path: Path, settings: dict[str, float], sticks: dict[str, float]
) -> None:
    limits = {"GF_MAX_HOR_DIST": 50.0, "GF_MAX_VER_DIST": 30.0}
    tester, pilot = hovering(tmp_path, **limits, **settings)
    distances = record(tester, lambda: distance(tester))
    heights = record(tester, lambda: tester.true_position()[2])
    change_mode(tester, POSITION)
    pilot.move(**sticks)
    tester.wait_until(lambda: tester.is_in(NavigationState.AUTO_LOITER), 20.0, "stopped")
    tester.run_for(6.0)
    assert max(distances) < 50.0
    assert max(heights) < 30.0
    assert max(distances) > 35.0 or max(heights) > 20.0  # And not long before it had to be
