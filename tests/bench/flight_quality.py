"""How well the whole autopilot flies, by the simulator's true state, on ten seeds each.

A bar on a root mean square holds for all seeds taken together, all other bars for the worst seed.

The autopilot's own bars are held with an RTK receiver. With a receiver of one band and without
corrections, the simulation's default, the true error is the receiver's, 1.4 m; the autopilot is
then judged by where it took itself to be.
"""

import multiprocessing
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

from tests.bench.flight_consistency import QUANTITIES
from tests.bench.flight_courses import (
    Figures,
    hover_and_land,
    return_from_afar,
    square_with_stops,
    two_laps,
)
from tests.bench.flight_failures import (
    battery_emergency,
    gps_lost_for_good,
    gps_outage,
    motor_lost,
)
from tests.bench.flight_orbit import orbit, orbit_too_fast
from tests.bench.flight_repeat import same_flight_twice
from tests.bench.flight_track import rms
from tests.bench.gyro_jump import gyro_jump
from tests.bench.results import Result, at_least, at_most

SEEDS: Final = range(1, 11)
LAP_TIME_BAR_S: Final = 36.5 * 1.10
M9N_BAR_M: Final = 2.0
"""The receiver's own error is 1.4 m RMS; over ten flights chance moves that by a sixth."""
CONSISTENT_PERCENT: Final = 95.0


@dataclass(frozen=True, slots=True)
class Bar:
    """What one figure of a flight is held against."""

    figure: str
    unit: str
    limit: float
    pooled: bool = False  # Root mean square over the seeds; else the worst of them
    lower: bool = False  # The limit is a lower one


@dataclass(frozen=True, slots=True)
class Flight:
    """A way to fly, given a seed, and the bars for it."""

    name: str
    fly: Callable[[int], Figures]
    bars: tuple[Bar, ...]


def _rms_bar(figure: str, limit: float) -> Bar:
    return Bar(figure, "m RMS", limit, pooled=True)


_CONSISTENT: Final = tuple(
    Bar(name, "% within 3 sigma", CONSISTENT_PERCENT, lower=True) for name in QUANTITIES
)
_UNHARMED: Final = Bar("unharmed", "(1: yes)", 1.0, lower=True)
_LANDING: Final = (
    Bar("landing", "m from the point", 0.5),
    Bar("touch-down", "m/s", 0.7),
    Bar("disarmed", "s after touch-down", 5.0),
    _UNHARMED,
)

_M9N_HOVER: Final = (
    _rms_bar("horizontal", M9N_BAR_M),
    _rms_bar("vertical", 0.40),
    Bar("touch-down", "m/s", 0.7),
    _UNHARMED,
)

FLIGHTS: Final = (
    Flight(
        "hover, RTK",
        partial(hover_and_land, gps="rtk", wind=0.0),
        (_rms_bar("horizontal", 0.15), _rms_bar("vertical", 0.15), *_LANDING, *_CONSISTENT),
    ),
    Flight(
        "hover, RTK, wind 6 m/s",
        partial(hover_and_land, gps="rtk", wind=6.0),
        (_rms_bar("horizontal", 0.25), _rms_bar("vertical", 0.25), *_LANDING, *_CONSISTENT),
    ),
    Flight(
        "hover, M9N",
        partial(hover_and_land, gps="m9n", wind=0.0),
        (_rms_bar("by estimate", 0.15), *_M9N_HOVER, *_CONSISTENT),
    ),
    Flight(
        "hover, M9N, wind 6 m/s",
        partial(hover_and_land, gps="m9n", wind=6.0),
        (_rms_bar("by estimate", 0.25), *_M9N_HOVER, *_CONSISTENT),
    ),
    Flight(
        "square, 2.5 m/s, RTK",
        partial(two_laps, speed=2.5, gps="rtk"),
        (_rms_bar("cross-track", 0.15), *_CONSISTENT),
    ),
    Flight(
        "square, 5 m/s, RTK",
        partial(two_laps, speed=5.0, gps="rtk"),
        (_rms_bar("cross-track", 0.15), Bar("time", "s for two laps", LAP_TIME_BAR_S)),
    ),
    Flight(
        "square, 2.5 m/s, RTK, wind 6 m/s",
        partial(two_laps, speed=2.5, gps="rtk", wind=6.0),
        (_rms_bar("cross-track", 0.25), *_CONSISTENT),
    ),
    Flight(
        "square, 2.5 m/s, M9N",
        partial(two_laps, speed=2.5, gps="m9n"),
        (_rms_bar("by estimate", 0.15), _rms_bar("cross-track", M9N_BAR_M), *_CONSISTENT),
    ),
    Flight(
        "square, 2.5 m/s, M9N, wind 6 m/s",
        partial(two_laps, speed=2.5, gps="m9n", wind=6.0),
        (_rms_bar("by estimate", 0.25), _rms_bar("cross-track", M9N_BAR_M), *_CONSISTENT),
    ),
    Flight(
        "square with stops, 2.5 m/s, RTK",
        partial(square_with_stops, speed=2.5, gps="rtk"),
        (_rms_bar("cross-track", 0.09), _rms_bar("mid-leg", 0.05), Bar("overshoot", "m", 1.0)),
    ),
    Flight(
        "square with stops, 5 m/s, RTK",
        partial(square_with_stops, speed=5.0, gps="rtk"),
        (_rms_bar("cross-track", 0.15), Bar("overshoot", "m", 1.0)),
    ),
    Flight(
        "orbit, 10 m, 20 deg/s",
        orbit,
        (
            _rms_bar("radius", 0.30),
            Bar("rate", "% off", 3.0),
            Bar("heading", "deg off", 10.0),
            Bar("turns", "deg off two turns", 3.0),
        ),
    ),
    Flight(
        "return from 100 m, wind 8 m/s",
        partial(return_from_afar, wind=8.0),
        (Bar("landing", "m from home", 1.0), *_LANDING[1:]),
    ),
    Flight(
        "GPS lost for 4 s in a mission, wind 3 m/s",
        gps_outage,
        (Bar("estimate", "m off", 5.0), Bar("track", "m beside", 5.0), _UNHARMED),
    ),
    Flight(
        "GPS lost for good, wind 3 m/s",
        gps_lost_for_good,
        (Bar("time", "s until disarmed", 60.0), Bar("touch-down", "m/s", 0.7), _UNHARMED),
    ),
    Flight(
        "battery emergency, 20 m up",
        battery_emergency,
        (Bar("charge", "% left on the ground", 0.5, lower=True), _UNHARMED),
    ),
    Flight(
        "gyroscope bias jumps by 3 deg/s on two axes, wind 8 m/s",
        gyro_jump,
        (Bar("off", "m from its place", 1.0), _UNHARMED),
    ),
    Flight(
        "gyroscope bias jumps by 10 deg/s on all axes at 8 m/s, wind 8 m/s",
        partial(gyro_jump, jump_deg_s=(10.0, -10.0, -10.0), cruise=True),
        (Bar("off", "m beside its leg", 4.0), _UNHARMED),
    ),
    Flight(
        "motor lost, 10 m up, wind 3 m/s",
        motor_lost,
        (
            Bar("alarm", "s after the loss", 0.5),
            Bar("fastest sink", "m/s", 4.0),
            Bar("touch-down", "m/s", 1.5),
            Bar("finite", "(1: no NaN)", 1.0, lower=True),
            _UNHARMED,
        ),
    ),
    Flight(
        "orbit, 10 m, 45 deg/s asked for",
        orbit_too_fast,
        (
            Bar("rate", "% off what is reported", 3.0),
            Bar("clipped", "(1: flown slower, and said so)", 1.0, lower=True),
            _rms_bar("radius", 0.30),
        ),
    ),
    Flight(
        "the same seed twice",
        same_flight_twice,
        (Bar("identical", "(1: byte for byte)", 1.0, lower=True),),
    ),
)


def measure() -> Iterator[Result]:
    """Fly every flight with every seed, on all cores."""
    jobs = [(number, seed) for number in range(len(FLIGHTS)) for seed in SEEDS]
    flown: dict[int, list[Figures]] = {number: [] for number in range(len(FLIGHTS))}
    with multiprocessing.Pool(len(os.sched_getaffinity(0))) as pool:
        for number, figures in pool.imap_unordered(_fly, jobs):
            if figures is not None:
                flown[number].append(figures)
    for number, flight in enumerate(FLIGHTS):
        yield from results(flight, flown[number])
    ended = [100.0 * len(figures) / len(SEEDS) for figures in flown.values()]
    yield at_least("flights that came to their end", min(ended), "%", 100.0, ended)


def _fly(job: tuple[int, int]) -> tuple[int, Figures | None]:
    """One flight; one that does not come to its end is reported and counted, and has no figures."""
    number, seed = job
    try:
        return number, FLIGHTS[number].fly(seed)
    except AssertionError:
        sys.stderr.write(f"{FLIGHTS[number].name}, seed {seed}:\n{traceback.format_exc()}")
        return number, None


def results(flight: Flight, flown: Sequence[Figures]) -> Iterator[Result]:
    """The rows of one flight."""
    if not flown:
        return
    for bar in flight.bars:
        values = [figures[bar.figure] for figures in flown]
        name = f"{flight.name}: {bar.figure}"
        if bar.pooled:
            yield at_most(f"{name}, all seeds", rms(values), bar.unit, bar.limit, values)
        elif bar.lower:
            yield at_least(name, min(values), bar.unit, bar.limit, values)
        else:
            yield at_most(name, max(values), bar.unit, bar.limit, values)


def by_name(flights: Sequence[Flight] = FLIGHTS) -> Mapping[str, Flight]:
    """The flights by their names."""
    return {flight.name: flight for flight in flights}
