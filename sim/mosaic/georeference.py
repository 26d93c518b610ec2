"""Where a picture was taken and what ground each pixel shows, by its EXIF and XMP alone.

The ground is level at the altitude of home, which is the picture's altitude less its height above
home. Angles are those of `drone-dji:`: yaw clockwise from north, pitch -90 straight down.

Errors:
    PictureError(ValueError): a file is no picture with a place; the message names file and reason.
"""

import math
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from sim.physics.earth import degrees_per_metre

Array = NDArray[np.float64]

_EXIF_IFD, _GPS_IFD = 0x8769, 0x8825
_MM_PER_UNIT: Final = {2: 25.4, 3: 10.0, 4: 1.0}  # Of FocalPlaneResolutionUnit
_STEEP_ENOUGH: Final = 0.05  # Down part of a ray that is taken to meet the ground


class PictureError(ValueError):
    """A file is not a picture with a position; the message names file and reason."""


@dataclass(frozen=True)
class Georeference:
    """Position and attitude of a picture, from its metadata."""

    path: Path
    latitude_deg: float
    longitude_deg: float
    altitude_m: float  # [m] Above mean sea level
    height_m: float  # [m] Above the ground
    yaw_deg: float
    pitch_deg: float
    roll_deg: float
    focal_px: float
    width_px: int
    height_px: int

    @cached_property
    def rotation(self) -> Array:
        """Columns: the camera's forward, right and down in north, east, down."""
        yaw, pitch, roll = (
            math.radians(each) for each in (self.yaw_deg, self.pitch_deg, self.roll_deg)
        )
        turned = np.array(
            [[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]]
        )
        pitched = np.array(
            [
                [math.cos(pitch), 0, math.sin(pitch)],
                [0, 1, 0],
                [-math.sin(pitch), 0, math.cos(pitch)],
            ]
        )
        rolled = np.array(
            [[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]]
        )
        product: Array = turned @ pitched @ rolled
        return product

    @property
    def corners(self) -> Array | None:
        """North and east [m] of the ground in the picture's corners, from below the camera.

        None if a corner looks over the ground.
        """
        half_right, half_down = (
            0.5 * size / self.focal_px for size in (self.width_px, self.height_px)
        )
        rays = [
            self.rotation @ np.array([1.0, right, down])
            for right, down in (
                (-half_right, -half_down),
                (half_right, -half_down),
                (half_right, half_down),
                (-half_right, half_down),
            )
        ]
        if any(ray[2] < _STEEP_ENOUGH for ray in rays):
            return None
        return np.array([self.height_m / ray[2] * ray[:2] for ray in rays])

    def pixels(self, north_m: Array, east_m: Array) -> tuple[Array, Array]:
        """Column and row [px] of places on the ground, north and east of below the camera."""
        matrix = self.rotation
        forward, right, down = (
            matrix[0, axis] * north_m + matrix[1, axis] * east_m + matrix[2, axis] * self.height_m
            for axis in range(3)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            column = 0.5 * self.width_px + self.focal_px * right / forward
            row = 0.5 * self.height_px + self.focal_px * down / forward
        behind = forward <= 0.0
        return np.where(behind, np.nan, column), np.where(behind, np.nan, row)

    def offset_m(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """North and east [m] of the camera from a place near it."""
        metre = degrees_per_metre(latitude_deg, self.altitude_m - self.height_m)
        east_deg = (self.longitude_deg - longitude_deg + 180.0) % 360.0 - 180.0
        return (self.latitude_deg - latitude_deg) / metre.north, east_deg / metre.east


def georeference(path: Path) -> Georeference:
    """Read position and attitude from the metadata of a picture.

    Raises:
        PictureError: if it is not a picture, or has no position.
        OSError: if it cannot be read.
    """
    try:
        with Image.open(path) as picture:
            tags, size = picture.getexif(), picture.size
            xmp = picture.info.get("xmp", b"").decode("utf-8", "replace")
    except UnidentifiedImageError as error:
        raise PictureError(f"{path}: no picture") from error
    details, gps = tags.get_ifd(_EXIF_IFD), tags.get_ifd(_GPS_IFD)
    try:
        return Georeference(
            path,
            _degrees(gps, 2, "S"),
            _degrees(gps, 4, "W"),
            _number(xmp, "AbsoluteAltitude"),
            _number(xmp, "RelativeAltitude"),
            _number(xmp, "GimbalYawDegree"),
            _number(xmp, "GimbalPitchDegree"),
            _number(xmp, "GimbalRollDegree"),
            float(details[0x920A]) * float(details[0xA20E]) / _MM_PER_UNIT[details[0xA210]],
            *size,
        )
    except (KeyError, ZeroDivisionError, TypeError) as error:
        raise PictureError(f"{path}: {error} is missing") from error


def _degrees(gps: dict[int, Any], number: int, negative: str) -> float:
    degrees, minutes, seconds = (float(part) for part in gps[number])
    value = degrees + minutes / 60.0 + seconds / 3600.0
    return -value if gps[number - 1] == negative else value


def _number(xmp: str, name: str) -> float:
    match = re.search(rf'drone-dji:{name}="([-+.\d]+)"', xmp)
    if match is None:
        raise KeyError(name)
    return float(match[1])
