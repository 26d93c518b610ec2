"""All pictures of a folder as one map, and what of the farm's fields it shows."""

import logging
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from PIL import Image

from sim.mosaic.georeference import Georeference, PictureError, georeference
from sim.mosaic.stitch import Mosaic, stitch
from sim.world.farm import Farm

log = logging.getLogger(__name__)


class Coverage(NamedTuple):
    """How much of a field the pictures show."""

    field: str
    share: float  # [-]


class Sheet(NamedTuple):
    """A map that has been written."""

    path: Path
    pictures: int  # With a position
    shown_ha: float
    fields: tuple[Coverage, ...]  # Of the farm, as far as they are shown at all


def pictures_in(folder: Path) -> Iterator[Georeference]:
    """The pictures of a folder by name; one without a position is left out with a warning."""
    for path in sorted(folder.glob("*.jpg")):
        try:
            yield georeference(path)
        except PictureError as error:
            log.warning("left out of the map: %s", error)


def write_mosaic(pictures: Sequence[Georeference], farm: Farm, path: Path) -> Sheet | None:
    """Write the map as a JPEG; None when no picture points down.

    Raises:
        OSError: if a picture cannot be read or the map not be written.
    """
    mosaic = stitch(pictures)
    if mosaic is None:
        return None
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(mosaic.colours.squeeze()).save(path, "JPEG", quality=85)
    found = (Coverage(name, share) for name, share in _coverage(mosaic, farm) if share > 0.0)
    return Sheet(path, len(pictures), mosaic.shown_m2 * 1e-4, tuple(found))


def _coverage(mosaic: Mosaic, farm: Farm) -> Iterator[tuple[str, float]]:
    origin = farm.plane.place(mosaic.latitude_deg, mosaic.longitude_deg)
    for field in farm.fields:
        ring = [(p.north_m - origin.north_m, p.east_m - origin.east_m) for p in field.boundary]
        yield field.name, mosaic.covered(ring)
