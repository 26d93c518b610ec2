"""Short distances over ground, which the whole vocabulary shares."""

from afarcloud.geodesy import Metres, distance_m, metres_per_degree, offset, shifted

__all__ = ["Metres", "distance_m", "metres_per_degree", "offset", "shifted"]
