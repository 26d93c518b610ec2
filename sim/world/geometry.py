"""Plane geometry of fields and rows: pure."""

import math
from collections.abc import Sequence

from sim.world.plane import Place


def edge_distance_m(boundary: Sequence[Place], place: tuple[float, float]) -> float:
    """Distance [m] to the edges of a convex, counter-clockwise ring; positive inside.

    Outside, beyond a corner, it is the distance to the farther edge's line: less than the distance.
    """
    nearest = math.inf
    for start, end in zip(boundary, [*boundary[1:], boundary[0]], strict=True):
        east, north = end.east_m - start.east_m, end.north_m - start.north_m
        left = east * (place[1] - start.north_m) - north * (place[0] - start.east_m)
        nearest = min(nearest, left / math.hypot(east, north))
    return nearest


def smooth_step(share: float) -> float:
    """0 below 0, 1 above 1, in between 3 s^2 - 2 s^3: no corner at either end."""
    held = min(1.0, max(0.0, share))
    return held * held * (3.0 - 2.0 * held)


def chord(
    boundary: Sequence[Place], through: Place, bearing_deg: float
) -> tuple[Place, Place] | None:
    """Where a line through a point enters and leaves a convex counter-clockwise ring.

    None if it misses the ring. The first end is the one that the bearing [deg] comes from.
    """
    bearing = math.radians(bearing_deg)
    direction = (math.sin(bearing), math.cos(bearing))
    first, last = -math.inf, math.inf
    for start, end in zip(boundary, [*boundary[1:], boundary[0]], strict=True):
        east, north = end.east_m - start.east_m, end.north_m - start.north_m
        gain = east * direction[1] - north * direction[0]
        left = east * (through.north_m - start.north_m) - north * (through.east_m - start.east_m)
        if abs(gain) < 1e-12:
            if left < 0.0:
                return None
        elif gain > 0.0:
            first = max(first, -left / gain)
        else:
            last = min(last, -left / gain)
    if first >= last:
        return None
    return _on(through, direction, first), _on(through, direction, last)


def _on(start: Place, direction: tuple[float, float], distance_m: float) -> Place:
    return Place(
        start.east_m + distance_m * direction[0], start.north_m + distance_m * direction[1]
    )
