"""How vehicles go round a point, and where their noses point meanwhile."""

from collections.abc import Mapping
from enum import Enum, auto
from typing import Final

from afarcloud.enumerations import OrbitType


class Orbiting(Enum):
    """How a vehicle goes round a point."""

    COUNTED = auto()  # DO_ORBIT with an angle, after which it holds by itself
    ENDLESS = auto()  # DO_ORBIT until told otherwise
    BY_ITEM = auto()  # NAV_LOITER_TURNS in a mission


STANDARD_HEADINGS: Final[Mapping[OrbitType, float]] = {
    OrbitType.ALONG_CIRCLE_LOOKING_FORWARDS: 3.0,
    OrbitType.TOWARDS_HOT_POINT: 0.0,
    OrbitType.CONTROLLED_BY_REMOTE_CONTROLLER: 4.0,
    OrbitType.USING_INITIAL_HEADING: 1.0,
}
"""ORBIT_YAW_BEHAVIOUR, the third parameter of DO_ORBIT."""
ITEM_HEADINGS: Final = {
    OrbitType.ALONG_CIRCLE_LOOKING_FORWARDS: 3.0,
    OrbitType.TOWARDS_HOT_POINT: 0.0,
}
"""What a circle in a mission knows: along it by a parameter, inwards by a ROI."""
OWN_HEADINGS: Final = {
    **STANDARD_HEADINGS,
    OrbitType.ALONG_CIRCLE_LOOKING_BACKWARDS: 6.0,
    OrbitType.AWAY_FROM_HOT_POINT: 7.0,
}
