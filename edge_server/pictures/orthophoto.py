"""Makes a picture for the map of a GeoTIFF; a separate program, as `reduce.py` is.

    orthophoto.py FILE LONGEST_SIDE_PX LARGEST_MEGAPIXELS COLOURS > smaller.webp

Pixels without a value are transparent. A file with one band of numbers from -1 to 1 is a vegetation
index (NDVI): it gets the COLOURS, a list in JSON of those of the values 0 to 1 in equal steps.

On a failure it exits with a sentence on stderr and status 1.
"""

import contextlib
import io
import json
import math
import resource
import sys
import warnings

from PIL import Image

MEMORY_BYTES = 1024 * 1024 * 1024
CPU_S = 60
QUALITY = 80
NO_DATA_TAG = 42113
"""GDAL's: the value of pixels without one, as text."""
Colours = list[tuple[int, int, int]]
FAILURES = (
    ValueError,
    OSError,
    SyntaxError,
    MemoryError,
    OverflowError,
    Image.DecompressionBombError,
    Image.DecompressionBombWarning,
)


def set_limits() -> None:
    """Limit memory and CPU time of this process."""
    for what, limit in ((resource.RLIMIT_AS, MEMORY_BYTES), (resource.RLIMIT_CPU, CPU_S)):
        with contextlib.suppress(ValueError):  # A lower limit is set already
            resource.setrlimit(what, (limit, limit))


def shown(path: str, side_px: int, largest_pixels: int, colours: Colours) -> bytes:
    """Give a WebP with sides of at most `side_px`.

    Raises:
        ValueError: if it has too many pixels, or pixels that cannot be shown.
        OSError: if it cannot be read, or is damaged.
    """
    Image.MAX_IMAGE_PIXELS = largest_pixels
    with Image.open(path, formats=("TIFF",)) as picture:
        width, height = picture.size
        if width * height > largest_pixels:
            raise ValueError(f"it has {width} x {height} pixels")
        factor = min(1.0, side_px / max(width, height))
        size = max(1, round(width * factor)), max(1, round(height * factor))
        if picture.mode == "F":
            small = _index(picture, size, colours)
        elif picture.mode in {"L", "P", "RGB", "RGBA", "LA"}:
            small = _colours(picture, size)
        else:
            raise ValueError(f"pixels of mode {picture.mode} are not supported")
    out = io.BytesIO()
    small.save(out, "WEBP", quality=QUALITY)
    return out.getvalue()


def _colours(picture: Image.Image, size: tuple[int, int]) -> Image.Image:
    has_alpha = picture.mode in {"RGBA", "LA"} or "transparency" in picture.info
    colours = picture.convert("RGBA" if has_alpha else "RGB")
    small = colours.resize(size, Image.Resampling.BOX)
    if not has_alpha and _no_data(picture) is not None:
        value = _no_data(picture)
        # Transparent where every band has the value, before anything is mixed
        bands = [band.point(lambda one: 255 if one != value else 0) for band in colours.split()]
        alpha = bands[0]
        for band in bands[1:]:
            alpha = Image.composite(Image.new("L", alpha.size, 255), alpha, band)
        small.putalpha(alpha.resize(size, Image.Resampling.BOX))
    return small


def _index(picture: Image.Image, size: tuple[int, int], colours: Colours) -> Image.Image:
    """Colour a vegetation index; its pixels are not mixed, since those without a value are huge."""
    small = picture.resize(size, Image.Resampling.NEAREST)
    no_data = _no_data(picture)
    coloured = Image.new("RGBA", size)
    pixels = []
    for value in small.get_flattened_data():
        number = float(value) if isinstance(value, float | int) else math.nan
        if math.isnan(number) or number == no_data or abs(number) > 1e30:
            pixels.append((0, 0, 0, 0))
        elif not -1.0 <= number <= 1.0:
            raise ValueError(
                f"one band with the value {number:g} is not supported, only a vegetation index "
                "from -1 to 1"
            )
        else:
            place = round(min(1.0, max(0.0, number)) * (len(colours) - 1))
            pixels.append((*colours[place], 255))
    coloured.putdata(pixels)
    return coloured


def _no_data(picture: Image.Image) -> float | None:
    tags = getattr(picture, "tag_v2", {})
    try:
        return float(str(tags[NO_DATA_TAG]).strip("\0 "))
    except (KeyError, ValueError):
        return None


def main() -> int:
    """Write stdout; give the exit status."""
    set_limits()
    warnings.simplefilter("error", Image.DecompressionBombWarning)
    path, side_px, megapixels = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    try:
        made = shown(path, side_px, megapixels * 1_000_000, json.loads(sys.argv[4]))
    except OSError:  # The library's text, a number of its decoder, helps nobody
        sys.stderr.write("its pixels are damaged or cut off: copy it again\n")
        return 1
    except FAILURES as error:
        sys.stderr.write(f"{error or type(error).__name__}\n")
        return 1
    sys.stdout.buffer.write(made)
    return 0


if __name__ == "__main__":
    sys.exit(main())
