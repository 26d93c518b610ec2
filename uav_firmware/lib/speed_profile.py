"""Jerk-limited speed along a line: the double-S profile in closed form.

A profile is a list of phases of constant jerk. A change of speed that begins and ends without
acceleration is symmetric, so it covers the mean of both speeds times its duration (Biagiotti
and Melchiorri 2008, "Trajectory Planning for Automatic Machines and Robots", section 3.4). The
fastest profile over a distance rises to a peak speed, cruises if there is room, and falls to
the end speed; the peak is found by bisection, since the distance grows with it. `brake` alone
begins with an acceleration.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

_BISECTIONS = 40  # halvings: an interval of 50 m/s shrinks below 1e-10 m/s
_SHORTEST = 1e-6  # [s] phases below this are left out


class Limits(NamedTuple):
    """Largest magnitudes along one line or axis."""

    speed: float  # [m/s]
    acceleration: float  # [m/s^2]
    jerk: float  # [m/s^3]


class Phase(NamedTuple):
    """A stretch of constant jerk."""

    duration: float  # [s]
    jerk: float  # [m/s^3]


def change_duration(difference: float, limits: Limits) -> float:
    """Shortest time [s] to change the speed by `difference` [m/s] from and to rest of jerk."""
    magnitude = abs(difference)
    if magnitude * limits.jerk >= limits.acceleration**2:
        return magnitude / limits.acceleration + limits.acceleration / limits.jerk
    return 2.0 * math.sqrt(magnitude / limits.jerk)


def change_distance(start: float, end: float, limits: Limits) -> float:
    """Distance [m] covered while the speed changes from `start` to `end` [m/s]."""
    return 0.5 * (start + end) * change_duration(end - start, limits)


def highest_start(distance: float, end: float, limits: Limits) -> float:
    """Highest speed [m/s] from which `end` can be reached within `distance` [m]."""
    return _largest(
        lambda start: change_distance(start, end, limits) <= distance, end, limits.speed
    )


def _largest(holds: Callable[[float], bool], low: float, high: float) -> float:
    """Largest value in [low, high] that holds; `holds` must hold at low and be monotone."""
    if low >= high or holds(high):
        return max(low, high)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _change_phases(start: float, end: float, limits: Limits) -> list[Phase]:
    difference = end - start
    jerk = math.copysign(limits.jerk, difference)
    duration = change_duration(difference, limits)
    if abs(difference) * limits.jerk >= limits.acceleration**2:
        ramp = limits.acceleration / limits.jerk
    else:
        ramp = 0.5 * duration
    phases = [Phase(ramp, jerk), Phase(duration - 2.0 * ramp, 0.0), Phase(ramp, -jerk)]
    return [phase for phase in phases if phase.duration > _SHORTEST]


def plan(distance: float, start: float, end: float, limits: Limits) -> list[Phase] | None:
    """Fastest profile over `distance` [m] from speed `start` to `end` [m/s], both unaccelerated.

    A start above the speed limit is slowed to it. None when the distance is too short to
    reach the end speed.
    """
    base = max(start, end)
    if change_distance(start, end, limits) > distance + 1e-9:
        return None

    def fits(peak: float) -> bool:
        needed = change_distance(start, peak, limits) + change_distance(peak, end, limits)
        return needed <= distance

    if start > limits.speed and fits(limits.speed):
        peak = limits.speed
    else:
        peak = _largest(fits, base, max(limits.speed, base))
    up, down = _change_phases(start, peak, limits), _change_phases(peak, end, limits)
    rest = distance - change_distance(start, peak, limits) - change_distance(peak, end, limits)
    cruise = [Phase(rest / peak, 0.0)] if peak > 0.0 and rest > _SHORTEST * peak else []
    return [*up, *cruise, *down]


def release(acceleration: float, limits: Limits) -> list[Phase]:
    """Bring the acceleration [m/s^2] to zero as fast as the jerk allows."""
    duration = abs(acceleration) / limits.jerk
    if duration <= _SHORTEST:
        return []
    return [Phase(duration, -math.copysign(limits.jerk, acceleration))]


def brake(speed: float, acceleration: float, limits: Limits) -> list[Phase]:
    """Come to rest from a speed [m/s] and an acceleration [m/s^2] of any sign.

    An acceleration beyond the limit that already brakes is kept until it can fall.
    """
    released = speed + acceleration * abs(acceleration) / (2.0 * limits.jerk)
    sign = math.copysign(1.0, released)
    # The ramps to a slope -p and back to 0 take (2 p^2 - a^2) / 2 j off the speed.
    squared = limits.jerk * sign * speed + 0.5 * acceleration * acceleration
    if released == 0.0 or squared <= 0.0:  # Both are 0 in the last ramp, but for their rounding
        return release(acceleration, limits)
    speed, acceleration = sign * speed, sign * acceleration
    enough = math.sqrt(squared)
    slope = min(enough, max(limits.acceleration, -acceleration))
    ramps = (2.0 * slope * slope - acceleration * acceleration) / (2.0 * limits.jerk)
    phases = [
        Phase((acceleration + slope) / limits.jerk, -sign * limits.jerk),
        Phase((speed - ramps) / slope, 0.0),
        Phase(slope / limits.jerk, sign * limits.jerk),
    ]
    return [phase for phase in phases if phase.duration > 0.0]


def cruise_for(distance: float, limits: Limits) -> list[Phase]:
    """Fastest profile from rest over `distance` [m] to rest; over an infinite one, for ever."""
    if math.isfinite(distance):
        return plan(distance, 0.0, 0.0, limits) or []
    return [*_change_phases(0.0, limits.speed, limits), Phase(math.inf, 0.0)]
