"""Where the nose points on a circle, and where the circle begins: AFarCloud's terms and MAVLink's.

ORBIT_YAW_BEHAVIOUR has no value for looking backwards or outwards; 6 and 7 are those of this
project's own autopilot.
"""

import math
from collections.abc import Mapping
from typing import Final

from afarcloud.enumerations import OrbitType, StartPoint
from edge_server.exchange.mission_item import Place

YAW_BEHAVIOUR: Final[Mapping[OrbitType, int]] = {
    OrbitType.TOWARDS_HOT_POINT: 0,
    OrbitType.USING_INITIAL_HEADING: 1,
    OrbitType.ALONG_CIRCLE_LOOKING_FORWARDS: 3,
    OrbitType.CONTROLLED_BY_REMOTE_CONTROLLER: 4,
    OrbitType.ALONG_CIRCLE_LOOKING_BACKWARDS: 6,
    OrbitType.AWAY_FROM_HOT_POINT: 7,
}
ORBIT_TYPE: Final = {behaviour: kind for kind, behaviour in YAW_BEHAVIOUR.items()}
BEGINNINGS: Final[Mapping[StartPoint, tuple[int, int]]] = {
    StartPoint.NORTH: (1, 0),
    StartPoint.SOUTH: (-1, 0),
    StartPoint.WEST: (0, -1),
    StartPoint.EAST: (0, 1),
}
"""North and east, in radii."""
NEAR_M: Final = 0.5


def beginning(centre: Place, radius_m: float, start: StartPoint) -> Place | None:
    """Where on the circle to begin; None leaves it to the vehicle."""
    if start not in BEGINNINGS:
        return None
    north, east = BEGINNINGS[start]
    return centre.moved(north * radius_m, east * radius_m)


def start_point(centre: Place, radius_m: float, place: Place) -> StartPoint | None:
    """Which beginning of the circle a place is; None if it is none."""
    if abs(place.relative_altitude_m - centre.relative_altitude_m) > NEAR_M:
        return None
    for start in BEGINNINGS:
        begin = beginning(centre, radius_m, start)
        if begin is not None and begin.distance_m(place) <= NEAR_M:
            return start
    return None


def angular_velocity_deg_s(speed_m_s: float, radius_m: float) -> float:
    """Of a flight along the circle; rounded, so that converting there and back yields the same."""
    return round(math.degrees(speed_m_s / radius_m), 9)
