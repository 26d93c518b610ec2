"""Flights on which something fails, each with another seed's weather and noise."""

import math
from typing import Final

from sim.fault_schedule import NEVER_US, Fault, Kind
from tests.bench.flight_courses import (
    HEIGHT_M,
    SQUARE,
    Figures,
    ready_vehicle,
    start_and_climb,
    takeoff_item,
    wait_for_item,
    waypoint,
)
from tests.bench.flight_track import Track, cross_track, places, touch_down
from tests.support.autopilot_tester import AutopilotTester

_LATER_S: Final = 3.0  # Into the first leg
_OUTAGE_S: Final = 4.0
_MOTOR_HEIGHT_M: Final = 10.0
_HOVERING_S: Final = 12.0
_BATTERY_HEIGHT_M: Final = 20.0
_BATTERY_CHARGE: Final = 0.04  # Below BAT_EMERGEN_THR


def break_now(
    tester: AutopilotTester, kind: Kind, seconds: float | None = None, **values: float
) -> None:
    """Let something fail from now on, for a time or for good."""
    now_us = tester.truth.time_us
    end_us = NEVER_US if seconds is None else now_us + round(seconds * 1e6)
    tester.simulation.add_fault(Fault(kind=kind, start_us=now_us, end_us=end_us, values=values))


def gps_outage(seed: int) -> Figures:
    """No fix for 4 s on the square; it brakes, holds and goes on with the mission."""
    tester = ready_vehicle(seed, wind=3.0)
    points = [waypoint(tester, n, at, HEIGHT_M) for n, at in enumerate(SQUARE[1:], start=1)]
    start_and_climb(tester, [takeoff_item(tester), *points])
    tester.run_for(_LATER_S)
    worst_m = 0.0

    def note() -> None:
        nonlocal worst_m
        worst_m = max(worst_m, estimate_error_m(tester))

    tester.watch(note)
    track = Track(tester)
    break_now(tester, Kind.GPS_LOSS, _OUTAGE_S)
    wait_for_item(tester, len(points), 120.0)
    return {
        "estimate": worst_m,
        "track": max(cross_track(places(track.samples), SQUARE)),
        "unharmed": 1.0,
    }


def estimate_error_m(tester: AutopilotTester) -> float:
    """Distance in space between belief and truth, altitude above mean sea level included."""
    place = tester.autopilot.topics.vehicle_global_position.value
    assert place is not None
    north, east = tester.north_east_m(place.latitude_deg, place.longitude_deg)
    true_north, true_east, _ = tester.true_position()
    up = place.altitude_amsl_m - tester.truth.altitude_amsl_m
    return math.hypot(north - true_north, east - true_east, up)


def gps_lost_for_good(seed: int) -> Figures:
    """The vehicle lands where it believes to be, and disarms."""
    tester = ready_vehicle(seed, wind=3.0)
    points = [waypoint(tester, n, at, HEIGHT_M) for n, at in enumerate(SQUARE[1:] * 4, start=1)]
    start_and_climb(tester, [takeoff_item(tester), *points])
    tester.run_for(_LATER_S)
    track = Track(tester)
    break_now(tester, Kind.GPS_LOSS)
    return _coming_down(tester, track)


def battery_emergency(seed: int) -> Figures:
    """The charge falls below the emergency threshold, 20 m up."""
    tester = ready_vehicle(seed, wind=3.0)
    far = waypoint(tester, 1, (60.0, 0.0), _BATTERY_HEIGHT_M)
    start_and_climb(tester, [takeoff_item(tester, _BATTERY_HEIGHT_M), far])
    tester.run_for(_LATER_S)
    track = Track(tester)
    break_now(tester, Kind.BATTERY_LOW, charge=_BATTERY_CHARGE)
    figures = _coming_down(tester, track)
    return {"charge": 100.0 * tester.simulation.battery_charge, **figures}


def motor_lost(seed: int) -> Figures:
    """One of the four motors stops for good, 10 m up, in 3 m/s of wind."""
    tester = ready_vehicle(seed, wind=3.0)
    tester.take_off(_MOTOR_HEIGHT_M)
    tester.run_for(_HOVERING_S)
    begin_s = tester.truth.time_us * 1e-6
    alarm_s = [math.inf]
    finite = [1.0]

    def note() -> None:
        topics = tester.autopilot.topics
        failure = topics.failure_detector_status.value
        if failure is not None and failure.failed_motors:
            alarm_s[0] = min(alarm_s[0], tester.truth.time_us * 1e-6 - begin_s)
        motors, estimate = topics.actuator_motors.value, topics.vehicle_local_position.value
        assert motors is not None
        assert estimate is not None
        numbers = (*motors.control, *estimate.position_ned, *estimate.velocity_ned)
        finite[0] *= math.isfinite(sum(numbers))

    tester.watch(note)
    track = Track(tester)
    break_now(tester, Kind.MOTOR_LOSS, motor=1 + seed % 4)
    figures = _coming_down(tester, track)
    fastest = max(sample.sink_m_s for sample in track.samples)
    return {"alarm": alarm_s[0], "fastest sink": fastest, "finite": finite[0], **figures}


def _coming_down(tester: AutopilotTester, track: Track) -> Figures:
    begin_s = tester.truth.time_us * 1e-6
    tester.wait_until_landed()
    return {
        "time": tester.truth.time_us * 1e-6 - begin_s,
        "touch-down": touch_down(track.samples).sink_m_s,
        "unharmed": 0.0 if tester.simulation.wrecked else 1.0,
    }
