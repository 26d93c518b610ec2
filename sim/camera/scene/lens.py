"""The lens and the place of the camera: the direction of each pixel. Pure.

A pinhole without distortion (Hartley and Zisserman 2004, "Multiple View Geometry", section 6.1).
The camera's frame is forward (along the optical axis), right, down. Column 0, row 0 is the top
left pixel; the centre of pixel (column, row) lies at (column + 0.5, row + 0.5).
"""

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sim.physics.truth import Quaternion, Vector3

Pixels: TypeAlias = NDArray[np.floating[Any]]
"""A number per pixel, mostly in single precision: good to 0.03 mm over the farm."""


class Lens(NamedTuple):
    """A lens and its sensor."""

    focal_length_mm: float  # [mm]
    sensor_width_mm: float  # [mm]
    sensor_height_mm: float  # [mm]
    width_px: int  # [px]
    height_px: int  # [px]

    @property
    def half_right(self) -> float:
        """Half the picture's width at unit distance [-]."""
        return 0.5 * self.sensor_width_mm / self.focal_length_mm

    @property
    def half_down(self) -> float:
        """Half the picture's height at unit distance [-]."""
        return 0.5 * self.sensor_height_mm / self.focal_length_mm

    @property
    def pixel(self) -> float:
        """Width of a pixel at unit distance [-]."""
        return 2.0 * self.half_right / self.width_px


class Pose(NamedTuple):
    """Where the camera truly is and looks."""

    latitude_deg: float  # [deg] WGS-84
    longitude_deg: float  # [deg] WGS-84
    altitude_amsl_m: float  # [m]
    q_ned_camera: Quaternion  # [-] Optical axis forward, right, down to NED


def rotation(q: Quaternion) -> NDArray[np.float64]:
    """Rotation matrix of a quaternion: its columns are the camera's axes in NED."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def multiplied(left: Quaternion, right: Quaternion) -> Quaternion:
    """Hamilton product: the rotation `right`, then the rotation `left`."""
    a, b, c, d = left
    w, x, y, z = right
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


class Rays(NamedTuple):
    """Where the pixels of some rows look: along east, north and up, one unit of depth long."""

    east: Pixels
    north: Pixels
    up: Pixels


def rays(lens: Lens, q_ned_camera: Quaternion, rows: slice) -> Rays:
    """Rays of a band of rows."""
    matrix = rotation(q_ned_camera)
    columns = np.arange(lens.width_px) + 0.5
    lines = np.arange(rows.start, rows.stop) + 0.5
    right = (2.0 * columns / lens.width_px - 1.0) * lens.half_right
    down = (2.0 * lines / lens.height_px - 1.0) * lens.half_down
    north, east, below = (
        (axis[0] + axis[1] * right[np.newaxis, :] + axis[2] * down[:, np.newaxis]).astype(
            np.float32
        )
        for axis in matrix
    )
    return Rays(east, north, -below)


def in_camera(q_ned_camera: Quaternion, offset_ned: Vector3) -> Vector3:
    """Forward, right and down [m] of a point that is so far from the camera."""
    forward, right, down = rotation(q_ned_camera).T @ np.array(offset_ned)
    return float(forward), float(right), float(down)
