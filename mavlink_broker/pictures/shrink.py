"""Reduces a picture to a number of bytes; a separate program, for safety.

    shrink.py LIMIT < picture > smaller.jpg

A picture comes from a vehicle's camera or from an attacker in its place. Pictures can exploit
decoders, and a few bytes can describe a terabyte of pixels. So this program runs beside the broker
with limits on memory and time, imports nothing of it, and may crash.

The result is a JPEG: first of lower quality, then of fewer pixels. EXIF and XMP, which contain the
position, are copied. On a failure it exits with a sentence on stderr and status 1.
"""

import contextlib
import io
import resource
import sys
import warnings

from PIL import (
    BmpImagePlugin,
    Image,
    ImageFile,
    JpegImagePlugin,
    PngImagePlugin,
    TiffImagePlugin,
    UnidentifiedImageError,
    WebPImagePlugin,
)

FORMATS = tuple(
    plugin.format
    for plugin in (
        JpegImagePlugin.JpegImageFile,
        PngImagePlugin.PngImageFile,
        TiffImagePlugin.TiffImageFile,
        WebPImagePlugin.WebPImageFile,
        BmpImagePlugin.BmpImageFile,
    )
    if plugin.format is not None
)
"""Supported formats; fewer decoders have fewer vulnerabilities."""
MEMORY_BYTES = 768 * 1024 * 1024
CPU_S = 30
LARGEST_PIXELS = 100_000_000
"""Of the picture, by its header."""
DECODED_PIXELS = 25_000_000
"""Of a picture that cannot be decoded at a fraction of its size: some 75 MB."""
QUALITIES = (88, 80, 70, 60)
SHRINKING = 0.8
SMALLEST_SIDE = 64
MARKER_BYTES = 65_000
"""The size of one segment of a JPEG; larger EXIF or XMP is not copied."""


def set_limits() -> None:
    """Limit memory and CPU time of this process."""
    for what, limit in ((resource.RLIMIT_AS, MEMORY_BYTES), (resource.RLIMIT_CPU, CPU_S)):
        with contextlib.suppress(ValueError):  # A lower limit is set already
            resource.setrlimit(what, (limit, limit))


def shrink(data: bytes, limit: int) -> bytes:
    """Give a JPEG of at most `limit` bytes.

    Raises:
        ValueError: if it cannot be read, is too large, or does not become small enough.
        OSError: if it is damaged.
    """
    picture = _open(data)
    marks = _marks(picture)
    pixels = picture.convert("RGB")
    while True:
        for quality in QUALITIES:
            smaller = _encode(pixels, quality, marks)
            if len(smaller) <= limit:
                return smaller
        width, height = (round(side * SHRINKING) for side in pixels.size)
        if min(width, height) < SMALLEST_SIDE:
            raise ValueError("it does not become small enough")
        pixels = pixels.resize((width, height), Image.Resampling.LANCZOS)


def _open(data: bytes) -> Image.Image:
    Image.MAX_IMAGE_PIXELS = LARGEST_PIXELS
    ImageFile.LOAD_TRUNCATED_IMAGES = False
    try:
        picture = Image.open(io.BytesIO(data), formats=FORMATS)
    except UnidentifiedImageError:  # Its text names the buffer, not the picture
        raise ValueError(f"it is no readable {', '.join(FORMATS)} picture") from None
    width, height = picture.size
    if width * height > LARGEST_PIXELS:
        raise ValueError(f"it has {width} x {height} pixels")
    if width * height > DECODED_PIXELS:
        factor = (DECODED_PIXELS / (width * height)) ** 0.5
        picture.draft("RGB", (int(width * factor), int(height * factor)))
    if picture.size[0] * picture.size[1] > 2 * DECODED_PIXELS:
        raise ValueError(f"it has {width} x {height} pixels")
    picture.load()
    return picture


def _marks(picture: Image.Image) -> dict[str, bytes]:
    found = {name: picture.info.get(name) for name in ("exif", "xmp", "icc_profile")}
    return {
        name: value
        for name, value in found.items()
        if isinstance(value, bytes) and 0 < len(value) <= MARKER_BYTES
    }


def _encode(pixels: Image.Image, quality: int, marks: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    pixels.save(out, "JPEG", quality=quality, optimize=False, **marks)
    return out.getvalue()


def main() -> int:
    """Read stdin, write stdout; give the exit status."""
    set_limits()
    warnings.simplefilter("error", Image.DecompressionBombWarning)
    try:
        smaller = shrink(sys.stdin.buffer.read(), int(sys.argv[1]))
    except (ValueError, OSError, SyntaxError, MemoryError, OverflowError) as error:
        sys.stderr.write(f"{error or type(error).__name__}\n")
        return 1
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    sys.stdout.buffer.write(smaller)
    return 0


if __name__ == "__main__":
    sys.exit(main())
