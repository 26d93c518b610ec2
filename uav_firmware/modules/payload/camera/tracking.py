"""Keeps a subject or a place on the ground in the picture. Pure.

When the camera detects a subject, its bounding boxes give its position on level ground at the
height of home, and an alpha-beta filter estimates its motion (Bar-Shalom, Li, Kirubarajan 2001,
"Estimation with Applications to Tracking and Navigation", section 6.5.3). Without a subject the
target is the fixed place on the ground at the point, or at the centre of the rectangle, and its
position in the picture is computed from the attitude. A target out of the picture for
`LOST_AFTER_US` is lost.
"""

import math
from typing import Final, NamedTuple

from uav_firmware.modules.payload.camera.gimbal import Place
from uav_firmware.modules.payload.camera.lens import PICTURE, in_picture, on_ground, ray_ned
from uav_firmware.msg.payload import Box, TrackingMode, TrackingStatus
from uav_firmware.msg.vectors import Quaternion, Vector3

LOST_AFTER_US: Final = 3_000_000
"""[us] A target is lost after this time out of the picture."""


ALPHA: Final = 0.2
BETA: Final = 0.02
"""Gains of the filter at 25 Hz: fast enough for a turning tractor, smooth enough for box jitter."""


class View(NamedTuple):
    """Position and attitude of the camera."""

    position_ned: Vector3  # [m]
    q_ned_camera: Quaternion  # [-]


class Target(NamedTuple):
    """A tracked target."""

    mode: TrackingMode
    position_ned: Vector3  # [m]
    extent: tuple[float, float]  # [-] Half width and height in the picture when chosen
    range_m: float  # [m] Slant range when chosen
    velocity_ned: Vector3 = (0.0, 0.0, 0.0)  # [m/s]
    is_subject: bool = False  # Detected by the camera; else a place on the ground


def choose(
    view: View, ground_down: float, rectangle: tuple[float, float, float, float], mode: TrackingMode
) -> Target | None:
    """Target at the centre of a rectangle (left, top, right, bottom); None above the horizon."""
    left, top, right, bottom = rectangle
    ray = ray_ned(view.q_ned_camera, 0.5 * (left + right), 0.5 * (top + bottom))
    place = on_ground(view.position_ned, ray, ground_down)
    if place is None:
        return None
    extent = (0.5 * (right - left), 0.5 * (bottom - top))
    return Target(mode, place, extent, math.dist(view.position_ned, place))


def around(x: float, y: float, radius: float) -> tuple[float, float, float, float]:
    """Square about a point; the radius is a fraction of the picture's width."""
    tall = radius * PICTURE.right / PICTURE.down
    return (x - radius, y - tall, x + radius, y + tall)


def aim_at(target: Target) -> Place:
    """Order that keeps a target at the centre of the picture."""
    return Place(target.position_ned)


def centre_of(box: Box) -> tuple[float, float]:
    """Centre of a box in the picture."""
    return 0.5 * (box.left + box.right), 0.5 * (box.top + box.bottom)


def predicted(target: Target, dt: float) -> Target:
    """Target after `dt` [s] at its present velocity."""
    moved = tuple(p + v * dt for p, v in zip(target.position_ned, target.velocity_ned, strict=True))
    return target._replace(position_ned=(moved[0], moved[1], moved[2]))


def corrected(target: Target, measured_ned: Vector3, dt: float) -> Target:
    """Predicted target corrected by a measured position [m, NED]."""
    errors = [seen - p for seen, p in zip(measured_ned, target.position_ned, strict=True)]
    place = [p + ALPHA * error for p, error in zip(target.position_ned, errors, strict=True)]
    speed = [v + BETA / dt * error for v, error in zip(target.velocity_ned, errors, strict=True)]
    return target._replace(
        position_ned=(place[0], place[1], place[2]), velocity_ned=(speed[0], speed[1], 0.0)
    )


class Sighting(NamedTuple):
    """Position of a target in the picture."""

    centre: tuple[float, float]  # [-] In the picture; NaN behind the camera
    extent: tuple[float, float]  # [-] Half width and height
    distance_m: float  # [m] Slant range
    inside: bool  # The centre lies in the picture


def sight(view: View, target: Target) -> Sighting:
    """Compute the position of a target in the picture; its size scales with 1/distance."""
    distance = math.dist(view.position_ned, target.position_ned)
    seen = in_picture(view.position_ned, view.q_ned_camera, target.position_ned)
    scale = target.range_m / distance if distance > 0.0 else math.inf
    extent = (min(target.extent[0] * scale, 1.0), min(target.extent[1] * scale, 1.0))
    inside = seen is not None and 0.0 <= seen[0] <= 1.0 and 0.0 <= seen[1] <= 1.0
    return Sighting(seen or (math.nan, math.nan), extent, distance, inside)


class Tracker:
    """Tracks a target until it is stopped or the target is lost."""

    def __init__(self) -> None:
        self.status = TrackingStatus.IDLE
        self.target: Target | None = None
        self.sighting: Sighting | None = None
        self._seen_us = 0
        self._is_seen = True  # The subject is in the picture

    def start(self, target: Target, now_us: int) -> None:
        """Track a target; it replaces the previous one."""
        self.target, self.status, self._seen_us = target, TrackingStatus.ACTIVE, now_us

    def stop(self) -> None:
        """Stop tracking."""
        self.status, self.target, self.sighting = TrackingStatus.IDLE, None, None

    def follow(self, view: View, box: Box | None, dt: float) -> Target | None:
        """Update a subject from its bounding box; None when the target is a fixed place."""
        target = self.target
        if target is None or not target.is_subject:
            return None
        target = predicted(target, dt)
        ray = None if box is None else ray_ned(view.q_ned_camera, *centre_of(box))
        ground_down = target.position_ned[2]
        place = None if ray is None else on_ground(view.position_ned, ray, ground_down)
        self._is_seen = place is not None
        self.target = target if place is None else corrected(target, place, dt)
        return self.target

    def update(self, view: View, now_us: int) -> bool:
        """Update the sighting; return whether the target is now lost."""
        if self.target is None:
            return False
        self.sighting = sight(view, self.target)
        if self.target.is_subject:
            self.sighting = self.sighting._replace(inside=self._is_seen)
        if self.sighting.inside:
            self._seen_us = now_us
        lost = now_us - self._seen_us > LOST_AFTER_US
        if lost:
            self.status, self.target, self.sighting = TrackingStatus.ERROR, None, None
        return lost
