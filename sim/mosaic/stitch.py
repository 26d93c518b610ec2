"""One map of many pictures: each cell of the ground is taken from the picture that shows it best.

Best is where the cell lies farthest from the picture's edge. Nothing is matched or adjusted: what
the metadata of the pictures say is all that is used, so that the map shows its accuracy.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sim.mosaic.georeference import Array, Georeference

LARGEST_PX: Final = 2400
STEEPEST_DEG: Final = -60.0
"""Pictures that look flatter than this are no maps [deg]."""


@dataclass(frozen=True)
class Mosaic:
    """A map with north up."""

    latitude_deg: float  # [deg] Of the origin that north and east are counted from
    longitude_deg: float
    north_m: float  # [m] Of the top edge
    west_m: float  # [m] East of the origin, of the left edge
    cell_m: float
    colours: NDArray[np.uint8]  # Rows from north to south, columns from west to east, bands
    count: NDArray[np.uint16]  # How many pictures show a cell

    def covered(self, ring: Sequence[tuple[float, float]]) -> float:
        """Share of a convex ring of north and east [m], counter-clockwise, that is shown."""
        inside = np.ones(self.count.shape, dtype=np.bool_)
        north, east = self.places()
        for start, end in zip(ring, [*ring[1:], ring[0]], strict=True):
            along = (end[1] - start[1]) * (north - start[0])
            inside &= along >= (end[0] - start[0]) * (east - start[1])
        beyond = _area(ring) - float(inside.sum()) * self.cell_m**2
        shown = float((inside & (self.count > 0)).sum()) * self.cell_m**2
        return shown / max(_area(ring), shown + max(0.0, beyond))

    def places(self) -> tuple[Array, Array]:
        """North and east [m] of the cells' middles: a column and a row."""
        rows, columns = self.count.shape
        north: Array = self.north_m - self.cell_m * (np.arange(rows, dtype=np.float64) + 0.5)
        east: Array = self.west_m + self.cell_m * (np.arange(columns, dtype=np.float64) + 0.5)
        return north[:, np.newaxis], east[np.newaxis, :]

    @property
    def shown_m2(self) -> float:
        """Ground that at least one picture shows [m^2]."""
        return float(np.count_nonzero(self.count)) * self.cell_m**2


def stitch(pictures: Iterable[Georeference], *, cell_m: float | None = None) -> Mosaic | None:
    """Lay pictures side by side; None when none of them looks down.

    Args:
        pictures: in any order.
        cell_m: [m] Edge of a cell; as fine as the map's size allows if it is not given.

    Raises:
        OSError: if a picture cannot be read.
    """
    used = [each for each in pictures if each.pitch_deg <= STEEPEST_DEG and _is_seen(each)]
    if not used:
        return None
    latitude = float(np.mean([each.latitude_deg for each in used]))
    longitude = used[0].longitude_deg
    offsets = [each.offset_m(latitude, longitude) for each in used]
    corners = np.concatenate(
        [np.asarray(each.corners) + offset for each, offset in zip(used, offsets, strict=True)]
    )
    (south, west), (north, east) = corners.min(axis=0), corners.max(axis=0)
    if cell_m is None:
        finest = min(each.height_m / each.focal_px for each in used)
        cell_m = max(finest, max(north - south, east - west) / LARGEST_PX)
    shape = (math.ceil((north - south) / cell_m), math.ceil((east - west) / cell_m))
    with Image.open(used[0].path) as first:
        bands = len(first.getbands())
    mosaic = Mosaic(
        latitude,
        longitude,
        float(north),
        float(west),
        cell_m,
        np.zeros((*shape, bands), dtype=np.uint8),
        np.zeros(shape, dtype=np.uint16),
    )
    best = np.zeros(shape, dtype=np.float32)
    for each, offset in zip(used, offsets, strict=True):
        _lay(mosaic, best, each, offset)
    return mosaic


def _is_seen(picture: Georeference) -> bool:
    return picture.height_m > 0.0 and picture.corners is not None


def _lay(
    mosaic: Mosaic, best: NDArray[np.float32], picture: Georeference, offset: tuple[float, float]
) -> None:
    """Put a picture's pixels where they are better than what lies there."""
    corners = np.asarray(picture.corners) + offset
    rows, columns = mosaic.count.shape
    top = max(0, math.floor((mosaic.north_m - corners[:, 0].max()) / mosaic.cell_m))
    bottom = min(rows, math.ceil((mosaic.north_m - corners[:, 0].min()) / mosaic.cell_m))
    left = max(0, math.floor((corners[:, 1].min() - mosaic.west_m) / mosaic.cell_m))
    right = min(columns, math.ceil((corners[:, 1].max() - mosaic.west_m) / mosaic.cell_m))
    part = (slice(top, bottom), slice(left, right))
    north, east = mosaic.places()
    column, row = picture.pixels(north[top:bottom] - offset[0], east[:, left:right] - offset[1])
    edge = np.minimum(
        np.minimum(column, picture.width_px - column), np.minimum(row, picture.height_px - row)
    )
    shown = edge > 0.0
    mosaic.count[part] += shown
    better = shown & (edge / picture.height_px > best[part])
    best[part][better] = (edge / picture.height_px)[better]
    with Image.open(picture.path) as image:
        pixels = np.asarray(image).reshape(picture.height_px, picture.width_px, -1)
    mosaic.colours[part][better] = pixels[
        row[better].astype(np.int64), column[better].astype(np.int64)
    ]


def _area(ring: Sequence[tuple[float, float]]) -> float:
    pairs = zip(ring, [*ring[1:], ring[0]], strict=True)
    return abs(0.5 * sum(a[1] * b[0] - b[1] * a[0] for a, b in pairs))
