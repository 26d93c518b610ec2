"""Which part of a picture may show a solid. Pure."""

import math
from typing import NamedTuple

from sim.camera.lens import Lens, in_camera
from sim.camera.solids import Solid
from sim.physics.truth import Quaternion, Vector3


class Box(NamedTuple):
    """Rows and columns of a part of the picture, each from the first to before the last [px]."""

    top: int
    bottom: int
    left: int
    right: int

    def within(self, band: slice) -> tuple[slice, slice] | None:
        """The part of the box in a band of rows, counted from the band's first; None for none."""
        top, bottom = max(band.start, self.top), min(band.stop, self.bottom)
        if top >= bottom or self.left >= self.right:
            return None
        return slice(top - band.start, bottom - band.start), slice(self.left, self.right)


def box_of(lens: Lens, q_ned_camera: Quaternion, solid: Solid, offset_ned: Vector3) -> Box | None:
    """Pixels of the picture that may show a solid: the box about its sphere; None for none.

    `offset_ned` [m] is where its middle is from the camera.
    """
    radius = solid.radius_m
    forward, right, down = in_camera(q_ned_camera, offset_ned)
    sides = (
        abs(right) - forward * lens.half_right - radius * math.hypot(1.0, lens.half_right),
        abs(down) - forward * lens.half_down - radius * math.hypot(1.0, lens.half_down),
    )
    if forward < -radius or max(sides) > 0.0:
        return None
    if forward <= 1.5 * radius:
        return Box(0, lens.height_px, 0, lens.width_px)
    column = 0.5 * lens.width_px * (1.0 + right / (forward * lens.half_right))
    row = 0.5 * lens.height_px * (1.0 + down / (forward * lens.half_down))
    # A sphere's picture is an ellipse that grows toward the edges of the picture
    slant = math.hypot(1.0, right / forward, down / forward) ** 2
    reach = 1.2 * radius * slant / ((forward - radius) * lens.pixel) + 2.0
    return Box(
        max(0, int(row - reach)),
        min(lens.height_px, int(row + reach) + 1),
        max(0, int(column - reach)),
        min(lens.width_px, int(column + reach) + 1),
    )
