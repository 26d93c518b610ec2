"""Geometry of the picture. Pure.

The camera frame is forward (along the optical axis), right, down. A point of the picture has
coordinates from 0, 0 (top left) to 1, 1 (bottom right). Projection by a pinhole camera without
distortion (Hartley and Zisserman 2004, "Multiple View Geometry", section 6.1).
"""

import math
from typing import Final, NamedTuple

from uav_firmware.lib.rotation import rotate, rotate_inverse
from uav_firmware.msg.payload import CameraLens
from uav_firmware.msg.vectors import Quaternion, Vector3

FARTHEST_M: Final = 2_000.0
"""[m] A ray that meets the ground beyond this distance counts as level."""

FOCAL_LENGTH_MM: Final = 4.5
SENSOR_WIDTH_MM: Final = 6.3
SENSOR_HEIGHT_MM: Final = 4.725


class Picture(NamedTuple):
    """Half the extent of the picture at unit distance along the optical axis."""

    right: float  # [-] tan of half the horizontal angle of view
    down: float  # [-] tan of half the vertical angle of view


PICTURE: Final = Picture(
    0.5 * SENSOR_WIDTH_MM / FOCAL_LENGTH_MM, 0.5 * SENSOR_HEIGHT_MM / FOCAL_LENGTH_MM
)


def lens(width_px: int) -> CameraLens:
    """Return the lens for pictures `width_px` wide and three quarters as high."""
    return CameraLens(
        FOCAL_LENGTH_MM, SENSOR_WIDTH_MM, SENSOR_HEIGHT_MM, width_px, width_px * 3 // 4
    )


def ray_ned(q_ned_camera: Quaternion, x: float, y: float) -> Vector3:
    """Direction in NED [-, not normalised] of the ray through a point of the picture."""
    in_camera = (1.0, (2.0 * x - 1.0) * PICTURE.right, (2.0 * y - 1.0) * PICTURE.down)
    return rotate(q_ned_camera, in_camera)


def on_ground(position_ned: Vector3, ray: Vector3, ground_down: float) -> Vector3 | None:
    """Intersection of a ray from a position with level ground at `ground_down` [m, NED].

    None when it points above the horizon, starts below the ground, or exceeds `FARTHEST_M`.
    """
    height = ground_down - position_ned[2]
    if not (ray[2] > 0.0 < height):
        return None
    scale = height / ray[2]
    if scale * math.hypot(ray[0], ray[1]) > FARTHEST_M:
        return None
    return (position_ned[0] + scale * ray[0], position_ned[1] + scale * ray[1], ground_down)


def in_picture(
    position_ned: Vector3, q_ned_camera: Quaternion, point_ned: Vector3
) -> tuple[float, float] | None:
    """Picture coordinates of a point [m, NED], also beyond the edges; None behind the camera."""
    away = tuple(there - here for there, here in zip(point_ned, position_ned, strict=True))
    forward, right, down = rotate_inverse(q_ned_camera, (away[0], away[1], away[2]))
    if forward <= 0.0:
        return None
    return (
        0.5 + 0.5 * right / (forward * PICTURE.right),
        0.5 + 0.5 * down / (forward * PICTURE.down),
    )


def direction_to(position_ned: Vector3, point_ned: Vector3) -> tuple[float, float]:
    """Pitch (up positive) and yaw from north [rad] of the direction to a point."""
    north, east, down = (t - h for t, h in zip(point_ned, position_ned, strict=True))
    return math.atan2(-down, math.hypot(north, east)), math.atan2(east, north)
