"""What a vehicle may be asked for, as far as a plan's rules need it."""

from afarcloud.model import Model
from afarcloud.numbers import MAXIMUM_HEIGHT_M

FARTHEST_M = 10_000.0
"""Beyond it a place is a mistake, such as a sign that is missing or 0, 0. It is also some three
times as far as a battery carries a multirotor there and back at 5 m/s for 20 minutes."""
LONGEST_LEG_M = 900.0
"""PX4's default of `MIS_DIST_WPS` in the versions that have it, and that of our own autopilot."""


class VehicleLimits(Model):
    """Limits of one registered vehicle; 0 for a leg of any length."""

    maximum_speed_m_s: float = 12.0
    maximum_height_above_home_m: float = MAXIMUM_HEIGHT_M
    farthest_m: float = FARTHEST_M  # Every place of a mission from its first one
    longest_leg_m: float = LONGEST_LEG_M  # From one place to the next
