"""GeoTIFFs as programs for aerial pictures write them: north up, with the tags of their place."""

import io
from collections.abc import Mapping
from typing import Final

from PIL import Image
from PIL.TiffImagePlugin import ImageFileDirectory_v2

SHORT, ASCII, DOUBLE = 3, 2, 12
SCALE, TIEPOINT, TRANSFORMATION, KEYS, NO_DATA = 33550, 33922, 34264, 34735, 42113
GEOGRAPHIC, PROJECTED = 2048, 3072
WGS_84: Final = {GEOGRAPHIC: 4326}


def utm(code: int) -> dict[int, int]:
    """Keys of a projected system."""
    return {PROJECTED: code}


def geotiff(
    picture: Image.Image,
    west: float,
    north: float,
    pixel: float,
    keys: Mapping[int, int] = WGS_84,
    **options: object,
) -> bytes:
    """A picture whose north-west corner and pixels are in the units of its system."""
    tags = ImageFileDirectory_v2()
    tags.tagtype |= {SCALE: DOUBLE, TIEPOINT: DOUBLE, TRANSFORMATION: DOUBLE, KEYS: SHORT}
    tags.tagtype[NO_DATA] = ASCII
    tags[SCALE] = (pixel, pixel, 0.0)
    tags[TIEPOINT] = (0.0, 0.0, 0.0, west, north, 0.0)
    rows = [each for key, value in keys.items() for each in (key, 0, 1, value)]
    tags[KEYS] = (1, 1, 0, len(keys), *rows)
    tags.update(options.pop("tags", {}))  # type: ignore[call-overload]
    for tag in options.pop("without", ()):  # type: ignore[attr-defined]
        del tags[tag]
    out = io.BytesIO()
    picture.save(out, "TIFF", tiffinfo=tags, **options)
    return out.getvalue()
