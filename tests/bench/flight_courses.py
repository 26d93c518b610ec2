"""Flights without faults. Each takes a seed and gives its figures by name, by true state.

The wind comes from another side with every seed. Commanded points are latitudes and longitudes
about the true place of the start, and heights above home as the vehicle defines home.
"""

import math
import tempfile
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from tests.bench.flight_consistency import Consistency
from tests.bench.flight_track import (
    Place,
    Track,
    cross_track,
    horizontal_rms,
    mid_leg_cross_track,
    overshoot,
    places,
    rms,
    touch_down,
    vertical_rms,
)
from tests.support.autopilot_tester import AutopilotTester

Figures = Mapping[str, float]

SIDE_M: Final = 20.0
SQUARE: Final[tuple[Place, ...]] = (
    (0.0, 0.0),
    (SIDE_M, 0.0),
    (SIDE_M, SIDE_M),
    (0.0, SIDE_M),
    (0.0, 0.0),
)
HOVER_POINT: Final = (6.0, -4.0)
HEIGHT_M: Final = 5.0
HOVER_S: Final = 60.0
_ACCEPTANCE_M: Final = 1.0
_STOP_S: Final = 2.0
_FAR_POINT: Final = (80.0, -60.0)
_FAR_HEIGHT_M: Final = 10.0


def ready_vehicle(
    seed: int, *, gps: str = "rtk", wind: float = 0.0, **config: Any
) -> AutopilotTester:
    """A vehicle that may be armed; its state directory goes when it goes.

    It has an RTK receiver unless said otherwise: the error of a receiver without corrections,
    1.4 m, would hide what the autopilot does.
    """
    simulation = SimulationConfig(
        seed=seed,
        gps=gps,
        wind_speed_m_s=wind,
        wind_from_deg=36.0 * seed,
        **config,
    )
    folder = tempfile.TemporaryDirectory()
    tester = AutopilotTester(simulation, Path(folder.name))
    weakref.finalize(tester, folder.cleanup)  # Missions are kept there, so it must last
    tester.wait_until_ready()
    return tester


def takeoff_item(tester: AutopilotTester, height_m: float = HEIGHT_M) -> Any:
    """Item 0: straight up from the start."""
    return tester.ground_station.mission_item(
        0, common.MAV_CMD_NAV_TAKEOFF, tester.place(0.0, 0.0, height_m), 0.0
    )


def waypoint(
    tester: AutopilotTester, seq: int, place: Place, height_m: float, hold_s: float = 0.0
) -> Any:
    """A waypoint, flown through unless it has a hold time."""
    return tester.ground_station.mission_item(
        seq,
        common.MAV_CMD_NAV_WAYPOINT,
        tester.place(*place, height_m),
        hold_s,
        _ACCEPTANCE_M,
        0.0,
    )


def land_item(tester: AutopilotTester, seq: int, place: Place) -> Any:
    """A landing at a place."""
    return tester.ground_station.mission_item(
        seq, common.MAV_CMD_NAV_LAND, tester.place(*place, 0.0)
    )


def start_and_climb(tester: AutopilotTester, items: list[Any]) -> None:
    """Upload, arm, and wait until the take-off item is reached."""
    tester.upload(items)
    tester.start_mission()
    wait_for_item(tester, 0, 40.0)


def wait_for_item(tester: AutopilotTester, seq: int, seconds: float) -> None:
    """Wait until the vehicle reports an item as reached."""
    station = tester.ground_station
    tester.wait_until(lambda: seq in station.items_reached, seconds, f"at item {seq}")


def hover_and_land(seed: int, *, gps: str, wind: float) -> Figures:
    """A minute at a point, the last 60 s of a hold, then a landing at that point."""
    tester = ready_vehicle(seed, gps=gps, wind=wind)
    hold = waypoint(tester, 1, HOVER_POINT, HEIGHT_M, HOVER_S + 5.0)
    start_and_climb(tester, [takeoff_item(tester), hold, land_item(tester, 2, HOVER_POINT)])
    track, consistency = Track(tester), Consistency(tester)
    wait_for_item(tester, 1, HOVER_S + 40.0)
    minute = track.last(HOVER_S)
    return {
        "horizontal": horizontal_rms(places(minute), HOVER_POINT),
        "by estimate": horizontal_rms(track.last_believed(HOVER_S), HOVER_POINT),
        "vertical": vertical_rms(minute, HEIGHT_M),
        **landing(tester, track, HOVER_POINT),
        **consistency.shares(),
    }


def landing(tester: AutopilotTester, track: Track, place: Place) -> Figures:
    """Wait for the end of the flight; how the vehicle came down."""
    tester.wait_until_landed()
    disarmed_s = tester.truth.time_us * 1e-6
    ground = touch_down(track.samples)
    north, east, _ = tester.true_position()
    return {
        "landing": math.dist((north, east), place),
        "touch-down": ground.sink_m_s,
        "disarmed": disarmed_s - ground.time_s,
        "unharmed": 0.0 if tester.simulation.wrecked else 1.0,
    }


def two_laps(seed: int, *, speed: float, gps: str, wind: float = 0.0) -> Figures:
    """The square twice, flown through, from the take-off item to the last waypoint."""
    tester = ready_vehicle(seed, gps=gps, wind=wind)
    tester.autopilot.registry.set("MPC_XY_CRUISE", speed)
    corners = SQUARE[1:] * 2
    points = [waypoint(tester, n, at, HEIGHT_M) for n, at in enumerate(corners, start=1)]
    start_and_climb(tester, [takeoff_item(tester), *points])
    track, consistency = Track(tester), Consistency(tester)
    begin_s = tester.truth.time_us * 1e-6
    wait_for_item(tester, len(corners), 150.0)
    return {
        "cross-track": rms(cross_track(places(track.samples), SQUARE)),
        "by estimate": rms(cross_track(track.believed, SQUARE)),
        "height": vertical_rms(track.samples, HEIGHT_M),
        "time": tester.truth.time_us * 1e-6 - begin_s,
        **consistency.shares(),
    }


def square_with_stops(seed: int, *, speed: float, gps: str, wind: float = 0.0) -> Figures:
    """The square once, two seconds at each corner."""
    tester = ready_vehicle(seed, gps=gps, wind=wind)
    tester.autopilot.registry.set("MPC_XY_CRUISE", speed)
    points = [
        waypoint(tester, seq, corner, HEIGHT_M, _STOP_S) for seq, corner in enumerate(SQUARE, 1)
    ]
    start_and_climb(tester, [takeoff_item(tester), *points])
    wait_for_item(tester, 1, 30.0)
    track = Track(tester)
    wait_for_item(tester, len(points), 120.0)
    return {
        "cross-track": rms(cross_track(places(track.samples), SQUARE)),
        "mid-leg": rms(mid_leg_cross_track(places(track.samples), SQUARE)),
        "overshoot": overshoot(track.samples, SIDE_M),
    }


def return_from_afar(seed: int, *, wind: float) -> Figures:
    """100 m out, then home by AUTO_RTL."""
    tester = ready_vehicle(seed, wind=wind)
    far = waypoint(tester, 1, _FAR_POINT, _FAR_HEIGHT_M, _STOP_S)
    start_and_climb(tester, [takeoff_item(tester, _FAR_HEIGHT_M), far])
    wait_for_item(tester, 1, 60.0)
    track = Track(tester)
    tester.return_home()
    return landing(tester, track, (0.0, 0.0))
