"""Distances to polygons on a plane, computed differently from the product."""

import math
from collections.abc import Sequence
from typing import TypeAlias

Metres: TypeAlias = tuple[float, float]
"""East and north [m]."""


def depth_m(polygon: Sequence[Metres], point: Metres) -> float:
    """Return the distance to the outline [m], negative outside.

    A point is inside when the outline turns about it by a whole circle.
    """
    turned, nearest = 0.0, math.inf
    for (ax, ay), (bx, by) in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
        one = math.atan2(ay - point[1], ax - point[0])
        other = math.atan2(by - point[1], bx - point[0])
        turned += math.remainder(other - one, math.tau)
        length = math.hypot(bx - ax, by - ay)
        along = 0.0
        if length > 0.0:
            along = ((point[0] - ax) * (bx - ax) + (point[1] - ay) * (by - ay)) / length**2
        along = max(0.0, min(1.0, along))
        foot = ax + along * (bx - ax), ay + along * (by - ay)
        nearest = min(nearest, math.dist(point, foot))
    return nearest if abs(turned) > math.pi else -nearest


def clearance_m(
    points: Sequence[Metres],
    inclusion: Sequence[Sequence[Metres]],
    exclusion: Sequence[Sequence[Metres]],
) -> float:
    """Return how far the worst of some points lies in the allowed area [m]; negative: outside."""
    worst = math.inf
    for point in points:
        if inclusion:
            worst = min(worst, max(depth_m(polygon, point) for polygon in inclusion))
        worst = min([worst, *(-depth_m(polygon, point) for polygon in exclusion)])
    return worst
