"""What a vehicle may be asked for, as far as a plan's rules need it."""

from afarcloud.model import Model
from afarcloud.numbers import MAXIMUM_HEIGHT_M


class VehicleLimits(Model):
    """Limits of one registered vehicle; a distance of 0 is no limit."""

    maximum_speed_m_s: float = 12.0
    maximum_height_above_home_m: float = MAXIMUM_HEIGHT_M
    farthest_m: float = 0.0  # Every place of a mission from its first one
    longest_leg_m: float = 0.0  # From one place to the next
