"""Orbits of 10 m radius at 20 deg/s and at 45, which is too fast; each seed its heading and sense.

Judged from the first turned degree, as the vehicle reports it, until it holds at the end of the
angle. The rate is the angle over the time between 10 and 90 % of it, the slopes left out; it is
held against the rate that the vehicle reports to fly.
"""

import itertools
import math
from typing import Final

from tests.bench.flight_courses import Figures, ready_vehicle
from tests.bench.flight_track import Sample, Track, rms
from tests.support.autopilot_tester import AutopilotTester
from uav_firmware.msg.guidance import OrbitHeading
from uav_firmware.msg.status import Command, NavigationState

RADIUS_M: Final = 10.0
CENTRE: Final = (12.0, 8.0)
HEIGHT_M: Final = 6.0
TURNS: Final = 2.0
RATE_DEG_S: Final = 20.0
_TOO_FAST_DEG_S: Final = 45.0
_SETTLED_S: Final = 1.5
_HEADINGS: Final = (
    OrbitHeading.FORWARDS,
    OrbitHeading.TOWARDS_CENTRE,
    OrbitHeading.BACKWARDS,
    OrbitHeading.AWAY,
    OrbitHeading.INITIAL,
    OrbitHeading.UNCHANGED,
)
"""Of AFarCloud's six: forwards, backwards, to and from the centre, and the two that stay."""


def orbit(seed: int) -> Figures:
    """Two turns; odd seeds clockwise, even ones the other way round."""
    return _fly(seed, RATE_DEG_S)[0]


def orbit_too_fast(seed: int) -> Figures:
    """Faster than the limits allow: it flies what it can, and reports that."""
    figures, reported_deg_s = _fly(seed, _TOO_FAST_DEG_S)
    return {**figures, "clipped": float(reported_deg_s < 0.9 * _TOO_FAST_DEG_S)}


def _fly(seed: int, rate_deg_s: float) -> tuple[Figures, float]:
    """Figures, and the rate [deg/s] that the vehicle reports to fly."""
    heading = _HEADINGS[(seed - 1) % len(_HEADINGS)]
    sense = 1.0 if seed % 2 else -1.0
    tester = ready_vehicle(seed)
    tester.take_off(HEIGHT_M)
    tester.wait_until(lambda: tester.mode is NavigationState.AUTO_LOITER, 40.0, "up")
    initial_deg = tester.truth.yaw_deg
    _order(tester, sense, heading, rate_deg_s)
    status = tester.autopilot.topics.orbit_status
    tester.wait_until(lambda: status.value is not None and status.value.turned > 0.0, 60.0, "there")
    assert status.value is not None
    reported_deg_s = math.degrees(status.value.speed_m_s / RADIUS_M)
    track = Track(tester)
    tester.wait_until(lambda: tester.mode is NavigationState.AUTO_LOITER, 90.0, "round")
    tester.run_for(_SETTLED_S)
    figures = _figures(track.samples, sense * reported_deg_s, heading, initial_deg)
    return figures, reported_deg_s


def _order(tester: AutopilotTester, sense: float, heading: OrbitHeading, rate_deg_s: float) -> None:
    latitude, longitude, _ = tester.place(*CENTRE, 0.0)
    home = tester.autopilot.topics.home_position.value
    assert home is not None
    tester.ground_station.command(
        Command.DO_ORBIT,
        sense * RADIUS_M,
        math.radians(rate_deg_s) * RADIUS_M,
        float(heading),
        TURNS * math.tau,
        latitude,
        longitude,
        home.altitude_amsl_m + HEIGHT_M,
    )
    tester.wait_until(lambda: tester.mode is NavigationState.ORBIT, 2.0, "in orbit mode")


def _figures(
    samples: list[Sample], rate_deg_s: float, heading: OrbitHeading, initial_deg: float
) -> Figures:
    sense = math.copysign(1.0, rate_deg_s)
    bearings = [
        math.degrees(math.atan2(s.east_m - CENTRE[1], s.north_m - CENTRE[0])) for s in samples
    ]
    steps = (math.remainder(b - a, 360.0) for a, b in itertools.pairwise(bearings))
    turned = list(itertools.accumulate(steps, initial=0.0))
    off = [
        abs(math.remainder(s.yaw_deg - _wanted_deg(bearing, sense, heading, initial_deg), 360.0))
        for s, bearing in zip(samples, bearings, strict=True)
    ]
    return {
        "radius": rms(math.dist((s.north_m, s.east_m), CENTRE) - RADIUS_M for s in samples),
        "heading": max(off),
        "turns": abs(sense * turned[-1] - 360.0 * TURNS),
        "rate": 100.0 * abs(_rate_deg_s(samples, turned) / rate_deg_s - 1.0),
    }


def _rate_deg_s(samples: list[Sample], turned: list[float]) -> float:
    middle = [
        (s.time_s, angle)
        for s, angle in zip(samples, turned, strict=True)
        if 0.1 <= abs(angle / turned[-1]) <= 0.9
    ]
    (begin_s, begin), (end_s, end) = middle[0], middle[-1]
    return (end - begin) / (end_s - begin_s)


def _wanted_deg(bearing: float, sense: float, heading: OrbitHeading, initial_deg: float) -> float:
    """Where the nose belongs at a bearing from the centre."""
    match heading:
        case OrbitHeading.FORWARDS:
            return bearing + 90.0 * sense
        case OrbitHeading.BACKWARDS:
            return bearing - 90.0 * sense
        case OrbitHeading.TOWARDS_CENTRE:
            return bearing + 180.0
        case OrbitHeading.AWAY:
            return bearing
        case _:
            return initial_deg
