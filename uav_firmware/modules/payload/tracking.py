"""Tracking: keeps a place on the ground in the picture. Pure.

Until a picture can be searched, the target is the place that lies under the point, or under the
middle of the rectangle, on a level ground at home's height; it does not move. Where it appears
in the picture is computed from the attitude, and it is lost when the gimbal cannot follow it.
"""

import math
from typing import Final, NamedTuple

from uav_firmware.modules.payload.gimbal import Place
from uav_firmware.modules.payload.lens import PICTURE, in_picture, on_ground, ray_ned
from uav_firmware.msg.payload import TrackingMode, TrackingStatus
from uav_firmware.msg.vectors import Quaternion, Vector3

LOST_AFTER_US: Final = 3_000_000
"""[us] Out of the picture for so long, a target is lost."""


class View(NamedTuple):
    """From where and how the camera looks."""

    position_ned: Vector3  # [m]
    q_ned_camera: Quaternion  # [-]


class Target(NamedTuple):
    """What is tracked."""

    mode: TrackingMode
    position_ned: Vector3  # [m]
    extent: tuple[float, float]  # [-] Half width and height in the picture when chosen
    range_m: float  # [m] Slant range when chosen


def choose(
    view: View, ground_down: float, rectangle: tuple[float, float, float, float], mode: TrackingMode
) -> Target | None:
    """Target under the middle of a rectangle (left, top, right, bottom); None above the horizon."""
    left, top, right, bottom = rectangle
    ray = ray_ned(view.q_ned_camera, 0.5 * (left + right), 0.5 * (top + bottom))
    place = on_ground(view.position_ned, ray, ground_down)
    if place is None:
        return None
    extent = (0.5 * (right - left), 0.5 * (bottom - top))
    return Target(mode, place, extent, math.dist(view.position_ned, place))


def around(x: float, y: float, radius: float) -> tuple[float, float, float, float]:
    """Square about a point; the radius is a share of the picture's width."""
    tall = radius * PICTURE.right / PICTURE.down
    return (x - radius, y - tall, x + radius, y + tall)


def aim_at(target: Target) -> Place:
    """The order that keeps a target in the middle of the picture."""
    return Place(target.position_ned)


class Sighting(NamedTuple):
    """Where a target is seen now."""

    centre: tuple[float, float]  # [-] In the picture; NaN behind the camera
    extent: tuple[float, float]  # [-] Half width and height
    distance_m: float  # [m] Slant range
    inside: bool  # The centre lies in the picture


def sight(view: View, target: Target) -> Sighting:
    """Look for a target; its size goes with the inverse of the distance."""
    distance = math.dist(view.position_ned, target.position_ned)
    seen = in_picture(view.position_ned, view.q_ned_camera, target.position_ned)
    scale = target.range_m / distance if distance > 0.0 else math.inf
    extent = (min(target.extent[0] * scale, 1.0), min(target.extent[1] * scale, 1.0))
    inside = seen is not None and 0.0 <= seen[0] <= 1.0 and 0.0 <= seen[1] <= 1.0
    return Sighting(seen or (math.nan, math.nan), extent, distance, inside)


class Tracker:
    """Holds a target until it is told to stop or has lost it."""

    def __init__(self) -> None:
        self.status = TrackingStatus.IDLE
        self.target: Target | None = None
        self.sighting: Sighting | None = None
        self._seen_us = 0

    def start(self, target: Target, now_us: int) -> None:
        """Track a target instead of any former one."""
        self.target, self.status, self._seen_us = target, TrackingStatus.ACTIVE, now_us

    def stop(self) -> None:
        """Track nothing."""
        self.status, self.target, self.sighting = TrackingStatus.IDLE, None, None

    def update(self, view: View, now_us: int) -> bool:
        """Look for the target; whether it is lost, out of the picture for `LOST_AFTER_US`."""
        if self.target is None:
            return False
        self.sighting = sight(view, self.target)
        if self.sighting.inside:
            self._seen_us = now_us
        lost = now_us - self._seen_us > LOST_AFTER_US
        if lost:
            self.status, self.target, self.sighting = TrackingStatus.ERROR, None, None
        return lost
