"""Where the rows and the drip lines of a field run: the same for the map and for the camera."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from sim.world.geometry import chord
from sim.world.layout import Field
from sim.world.plane import Place


class Row(NamedTuple):
    """A straight line across a field, from edge to edge."""

    number: int  # [-] Row k lies at k row spacings across, counted from the map's origin
    start: Place  # [m]
    end: Place  # [m]
    irrigated: bool  # A drip line lies along it


def rows(field: Field) -> Iterator[Row]:
    """The rows of a field, from left to right of their bearing; none where nothing is sown so."""
    if field.row_spacing_m <= 0.0:
        return
    east, north = field.across
    offsets = [corner.east_m * east + corner.north_m * north for corner in field.boundary]
    first = math.ceil(min(offsets) / field.row_spacing_m)
    last = math.floor(max(offsets) / field.row_spacing_m)
    for number in range(first, last + 1):
        offset = number * field.row_spacing_m
        ends = chord(field.boundary, Place(offset * east, offset * north), field.row_bearing_deg)
        if ends is not None:
            yield Row(number, *ends, irrigated=is_irrigated(field, number))


def is_irrigated(field: Field, number: int) -> bool:
    """Whether a drip line lies along a row."""
    return field.drip_every > 0 and number % field.drip_every == 0
