"""Reduces a picture to a few pixels; a separate program, for safety and for memory.

    reduce.py LONGEST_SIDE_PX LARGEST_MEGAPIXELS < picture > smaller.jpg

A picture comes from a vehicle's camera or from an attacker in its place. Pictures can exploit
decoders, and a few bytes can describe a terabyte of pixels. So this program runs beside the edge
server with limits on memory and time, imports nothing of it, and may crash. The edge server does
not load the library, whose memory it would keep.

On a failure it exits with a sentence on stderr and status 1.
"""

import contextlib
import io
import resource
import sys
import warnings

from PIL import Image, ImageFile, ImageOps, UnidentifiedImageError

FORMATS = ("JPEG", "PNG", "TIFF", "WEBP")
"""Fewer decoders have fewer vulnerabilities."""
MEMORY_BYTES = 512 * 1024 * 1024
CPU_S = 10
DECODED_PIXELS = 25_000_000
"""Of a picture that cannot be decoded at a fraction of its size: some 100 MB."""
QUALITY = 80
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


def reduced(data: bytes, side_px: int, largest_pixels: int) -> bytes:
    """Give a JPEG with sides of at most `side_px`, upright, without EXIF.

    Raises:
        ValueError: if it has too many pixels.
        OSError: if it cannot be read, or is damaged.
    """
    Image.MAX_IMAGE_PIXELS = largest_pixels
    ImageFile.LOAD_TRUNCATED_IMAGES = False
    try:
        picture = Image.open(io.BytesIO(data), formats=FORMATS)
    except UnidentifiedImageError:  # Its text names the buffer, not the picture
        raise ValueError(f"it is no readable {', '.join(FORMATS)} picture") from None
    width, height = picture.size
    picture.draft("RGB", (side_px, side_px))  # A JPEG is decoded at 1/2, 1/4 or 1/8
    if width * height > largest_pixels or picture.width * picture.height > DECODED_PIXELS:
        raise ValueError(f"it has {width} x {height} pixels")
    picture.thumbnail((side_px, side_px))
    out = io.BytesIO()
    ImageOps.exif_transpose(picture).convert("RGB").save(out, "JPEG", quality=QUALITY)
    return out.getvalue()


def main() -> int:
    """Read stdin, write stdout; give the exit status."""
    set_limits()
    warnings.simplefilter("error", Image.DecompressionBombWarning)
    side_px, megapixels = (int(argument) for argument in sys.argv[1:])
    try:
        smaller = reduced(sys.stdin.buffer.read(), side_px, megapixels * 1_000_000)
    except FAILURES as error:
        sys.stderr.write(f"{error or type(error).__name__}\n")
        return 1
    sys.stdout.buffer.write(smaller)
    return 0


if __name__ == "__main__":
    sys.exit(main())
