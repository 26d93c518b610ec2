"""What ground a picture shows, and in which band, by its XMP alone. Pure.

Place, height above home and attitude are those of DJI's names, the lens those of Pix4D's
(`Camera:`, focal length and principal point in mm). The ground is taken to be level at home.
"""

import math
import re
from typing import Final, NamedTuple

from afarcloud.geodesy import LocalPlane
from afarcloud.plan import Vertex

RGB: Final = "rgb"
BANDS: Final = (RGB, "nir", "ndvi")
"""What a picture may show: colours, near infrared, vegetation index."""
OTHER_BAND: Final = "other"
HEAD_BYTES: Final = 65_536
"""Where a camera writes its XMP."""
STEEPEST_DEG: Final = -60.0
"""Pictures that look flatter than this are no maps [deg]."""
_STEEP_ENOUGH: Final = 0.2
"""Down part of a ray that is taken to meet the ground."""
_NUMBER: Final = rb"([-+]?\d+(?:\.\d*)?)"


class Place(NamedTuple):
    """A place, and its height above home."""

    latitude_deg: float
    longitude_deg: float
    relative_altitude_m: float


def footprint(head: bytes) -> tuple[Vertex, ...] | None:
    """Give the ground at the picture's corners, from the top left on clockwise.

    None for a picture without these data, or one that does not look down.
    """
    found = [_number(head, b"drone-dji:" + name) for name in (*_PLACE, *_ATTITUDE)]
    focal_mm = _number(head, b"Camera:PerspectiveFocalLength")
    middle = re.search(rb'Camera:PrincipalPoint(?:="|>)' + _NUMBER + b"," + _NUMBER, head)
    if None in found or not focal_mm or middle is None:
        return None
    latitude, longitude, height_m, yaw, pitch, roll = (float(each or 0.0) for each in found)
    if pitch > STEEPEST_DEG or height_m <= 0.0 or abs(latitude) > 89.0:
        return None
    right, down = float(middle[1]) / focal_mm, float(middle[2]) / focal_mm
    plane = LocalPlane.at(latitude, longitude)
    corners = []
    for across, below in ((-right, -down), (right, -down), (right, down), (-right, down)):
        north, east, downward = _turned((1.0, across, below), yaw, pitch, roll)
        if downward < _STEEP_ENOUGH:
            return None
        corners.append(plane.to_globe(height_m * north / downward, height_m * east / downward))
    return tuple(corners)


def place(head: bytes) -> Place | None:
    """Give where the picture was taken; None for a picture that does not say it.

    Cameras write 0, 0 while they do not know it.
    """
    latitude, longitude, height_m = (_number(head, b"drone-dji:" + name) for name in _PLACE)
    if latitude is None or longitude is None or height_m is None:
        return None
    is_possible = abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and abs(height_m) < 1e5
    is_known = is_possible and (latitude, longitude) != (0.0, 0.0)
    return Place(latitude, longitude, height_m) if is_known else None


def band(head: bytes) -> str:
    """Give what a picture shows by Pix4D's `Camera:BandName`: one of `BANDS`, or `OTHER_BAND`.

    A picture without this name, and one of red, green and blue, shows colours.
    """
    named = _BAND_NAME.search(head)
    if named is None:
        return RGB
    parts = _TAG.sub(b"\n", named["attribute"] or named["element"] or b"").splitlines()
    names = {part.strip().lower().decode("ascii", "replace") for part in parts} - {""}
    if names in ({"red", "green", "blue"}, {RGB}):
        return RGB
    return names.pop() if len(names) == 1 and names <= set(BANDS) else OTHER_BAND


_BAND_NAME: Final = re.compile(
    rb'Camera:BandName(?:="(?P<attribute>[^"]{0,80})"|>(?P<element>.{0,400}?)</Camera:BandName)',
    re.DOTALL,
)
_TAG: Final = re.compile(rb"<[^>]*>")
_PLACE: Final = (b"GpsLatitude", b"GpsLongitude", b"RelativeAltitude")
_ATTITUDE: Final = (b"GimbalYawDegree", b"GimbalPitchDegree", b"GimbalRollDegree")


def _number(head: bytes, name: bytes) -> float | None:
    """Read a value that is an attribute or an element."""
    found = re.search(name + rb'(?:="|>)' + _NUMBER, head)
    return None if found is None else float(found[1])


def _turned(
    ray: tuple[float, float, float], yaw_deg: float, pitch_deg: float, roll_deg: float
) -> tuple[float, float, float]:
    """Turn a ray from the camera's forward, right and down to north, east and down."""
    forward, right, down = ray
    yaw, pitch, roll = (math.radians(each) for each in (yaw_deg, pitch_deg, roll_deg))
    right, down = (
        right * math.cos(roll) - down * math.sin(roll),
        right * math.sin(roll) + down * math.cos(roll),
    )
    forward, down = (
        forward * math.cos(pitch) + down * math.sin(pitch),
        down * math.cos(pitch) - forward * math.sin(pitch),
    )
    return (
        forward * math.cos(yaw) - right * math.sin(yaw),
        forward * math.sin(yaw) + right * math.cos(yaw),
        down,
    )
