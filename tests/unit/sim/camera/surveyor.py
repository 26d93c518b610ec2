"""A surveyor's way from a picture to the ground, from its EXIF and XMP alone.

Shares nothing with the simulator: WGS-84 by Earth-centred coordinates, the attitude by three
rotations one after the other, the lens by focal length and pixel pitch. The camera's names and
signs are those that DJI and EXIF document: yaw clockwise from north, pitch up positive, -90
straight down; roll clockwise.
"""

import io
import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

A_M, F = 6_378_137.0, 1.0 / 298.257223563
E2 = F * (2.0 - F)


def ecef(latitude_deg: float, longitude_deg: float, height_m: float) -> NDArray[np.float64]:
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    n = A_M / math.sqrt(1.0 - E2 * math.sin(latitude) ** 2)
    return np.array(
        [
            (n + height_m) * math.cos(latitude) * math.cos(longitude),
            (n + height_m) * math.cos(latitude) * math.sin(longitude),
            (n * (1.0 - E2) + height_m) * math.sin(latitude),
        ]
    )


def axes_ned(latitude_deg: float, longitude_deg: float) -> NDArray[np.float64]:
    """Rows: north, east and down at a place, in Earth-centred coordinates."""
    sin_lat, cos_lat = math.sin(math.radians(latitude_deg)), math.cos(math.radians(latitude_deg))
    sin_lon, cos_lon = math.sin(math.radians(longitude_deg)), math.cos(math.radians(longitude_deg))
    return np.array(
        [
            [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
            [-sin_lon, cos_lon, 0.0],
            [-cos_lat * cos_lon, -cos_lat * sin_lon, -sin_lat],
        ]
    )


@dataclass(frozen=True)
class Survey:
    """Metadata of a picture."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    yaw_deg: float
    pitch_deg: float
    roll_deg: float
    focal_px: float
    width_px: int
    height_px: int

    def pixel(self, latitude_deg: float, longitude_deg: float, altitude_m: float) -> Any:
        """Column and row [px] where a point is seen; None behind the camera."""
        here = ecef(self.latitude_deg, self.longitude_deg, self.altitude_m)
        there = ecef(latitude_deg, longitude_deg, altitude_m)
        ned = axes_ned(self.latitude_deg, self.longitude_deg) @ (there - here)
        forward, right, down = self._body(ned)
        if forward <= 0.0:
            return None
        column = 0.5 * self.width_px + self.focal_px * right / forward
        return column, 0.5 * self.height_px + self.focal_px * down / forward

    def _body(self, ned: NDArray[np.float64]) -> NDArray[np.float64]:
        """Turn by yaw, then by pitch, then by roll."""
        cos_y, sin_y = math.cos(math.radians(self.yaw_deg)), math.sin(math.radians(self.yaw_deg))
        cos_p, sin_p = (
            math.cos(math.radians(self.pitch_deg)),
            math.sin(math.radians(self.pitch_deg)),
        )
        cos_r, sin_r = math.cos(math.radians(self.roll_deg)), math.sin(math.radians(self.roll_deg))
        yawed = np.array(
            [cos_y * ned[0] + sin_y * ned[1], -sin_y * ned[0] + cos_y * ned[1], ned[2]]
        )
        pitched = np.array(
            [cos_p * yawed[0] - sin_p * yawed[2], yawed[1], sin_p * yawed[0] + cos_p * yawed[2]]
        )
        return np.array(
            [
                pitched[0],
                cos_r * pitched[1] + sin_r * pitched[2],
                -sin_r * pitched[1] + cos_r * pitched[2],
            ]
        )


def read(jpeg: bytes) -> tuple[Survey, NDArray[np.uint8]]:
    """A picture's metadata and its pixels."""
    with Image.open(io.BytesIO(jpeg)) as picture:
        tags = picture.getexif()
        details, gps = tags.get_ifd(0x8769), tags.get_ifd(0x8825)
        xmp = picture.info["xmp"].decode()
        pixels = np.asarray(picture)

    def angle(name: str) -> float:
        match = re.search(rf'drone-dji:Gimbal{name}Degree="([-+.\d]+)"', xmp)
        assert match is not None
        return float(match[1])

    def degrees(number: int, negative: str) -> float:
        parts = [float(part) for part in gps[number]]
        value = parts[0] + parts[1] / 60.0 + parts[2] / 3600.0
        return -value if gps[number - 1] == negative else value

    per_mm = float(details[0xA20E]) / {2: 25.4, 3: 10.0}[details[0xA210]]
    return (
        Survey(
            degrees(2, "S"),
            degrees(4, "W"),
            float(gps[6]) * (-1.0 if gps[5] == b"\x01" else 1.0),
            angle("Yaw"),
            angle("Pitch"),
            angle("Roll"),
            float(details[0x920A]) * per_mm,
            pixels.shape[1],
            pixels.shape[0],
        ),
        pixels,
    )
