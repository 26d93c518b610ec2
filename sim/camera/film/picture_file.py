"""From an order to files: render, encode, write whole or not at all."""

import io
from pathlib import Path
from typing import Final, NamedTuple

from PIL import Image as PillowImage

from sim.camera.film.metadata import exif, xmp
from sim.camera.film.orders import Order
from sim.camera.picture import Image, render

QUALITY: Final = 82
THUMBNAIL_PX: Final = 640
"""Width of the small picture; with its quality it takes some 50 KiB."""
_THUMBNAIL_QUALITY: Final = 78
_INDEX_SCALE: Final = "NDVI = value / 127.5 - 1; 0 is no ground"


class Stored(NamedTuple):
    """What has been written."""

    size_bytes: int  # [B] Together
    files: int


def write_picture(order: Order) -> Stored:
    """Store the picture, its small copy and, where it is wanted, the second one.

    Raises:
        OSError: if a file cannot be written; then none of them is there.
    """
    image = render(order.shot)
    files = {order.path: _picture(order, image), order.thumbnail_path: _thumbnail(order, image)}
    if order.second:
        files[order.second_path] = _second(order, image)
    written: list[Path] = []
    try:
        for path, content in files.items():
            written.append(Path(path))
            _write(Path(path), content)
    except OSError:
        for done in written:
            done.unlink(missing_ok=True)
        raise
    return Stored(sum(map(len, files.values())), len(files))


def _picture(order: Order, image: Image) -> bytes:
    return _jpeg(order, PillowImage.fromarray(image.colour), "RGB")


def _thumbnail(order: Order, image: Image) -> bytes:
    lens = order.lens
    size = (THUMBNAIL_PX, max(1, round(THUMBNAIL_PX * lens.height_px / lens.width_px)))
    small = PillowImage.fromarray(image.colour).resize(size, PillowImage.Resampling.BOX)
    lens = lens._replace(width_px=size[0], height_px=size[1])
    stream = io.BytesIO()
    small.save(
        stream,
        "JPEG",
        quality=_THUMBNAIL_QUALITY,
        exif=exif(order.estimate, lens, order.number),
        xmp=xmp(order.estimate, lens, "RGB"),
    )
    return stream.getvalue()


def _second(order: Order, image: Image) -> bytes:
    if order.second == "nir":
        return _jpeg(order, PillowImage.fromarray(image.near_infrared), "NIR")
    return _jpeg(order, PillowImage.fromarray(image.vegetation_index), "NDVI", _INDEX_SCALE)


def _jpeg(order: Order, image: PillowImage.Image, band: str, description: str = "") -> bytes:
    stream = io.BytesIO()
    image.save(
        stream,
        "JPEG",
        quality=QUALITY,
        exif=exif(order.estimate, order.lens, order.number, description),
        xmp=xmp(order.estimate, order.lens, band),
    )
    return stream.getvalue()


def _write(path: Path, content: bytes) -> None:
    """Write a file that is never seen half done: beside its folder first, then moved."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.parent.parent / f".{path.name}.part"
    try:
        unfinished.write_bytes(content)
        unfinished.replace(path)
    except OSError:
        unfinished.unlink(missing_ok=True)
        raise
