"""Lays pictures out as one map; a separate program, for safety and for memory.

    mosaic.py LONGEST_SIDE_PX LARGEST_MEGAPIXELS < pictures > map

The input is a line of JSON and then each picture: its size in 8 bytes, big-endian, and its bytes.
The JSON has `footprints`, the corners of each picture on the ground (latitude and longitude, from
its top left on clockwise), and `colours`: null, or red, green, blue and opacity for each of the 256
grey values of the pictures. The output is a line of JSON (size, corners from the north-west on
clockwise, metres per pixel, number of pictures) and a WebP.

Of the pictures that show a place, the one whose middle is nearest to it is drawn: it looks down
most steeply there. Seams stay as they are. A place that the nearest picture does not show is filled
by another one. A picture that cannot be read is left out.

Limits, libraries and reasons are those of `reduce.py`.
"""

import contextlib
import io
import json
import math
import resource
import struct
import sys
import warnings
from collections.abc import Iterator, Sequence
from typing import BinaryIO

from PIL import Image, ImageChops, ImageDraw, ImageFile, UnidentifiedImageError

FORMATS = ("JPEG", "PNG", "TIFF", "WEBP")
MEMORY_BYTES = 768 * 1024 * 1024
CPU_S = 600
DECODED_PIXELS = 25_000_000
METRES_PER_DEGREE = 111_319.49
QUALITY = 82
FAILURES = (
    ValueError,
    OSError,
    SyntaxError,
    MemoryError,
    OverflowError,
    Image.DecompressionBombError,
    Image.DecompressionBombWarning,
)
Point = tuple[float, float]
"""Across and down, in pixels of the map."""


class Frame:
    """The part of the earth that the map shows: north up, level, so many pixels wide and high."""

    def __init__(self, footprints: Sequence[Sequence[Sequence[float]]], longest_px: int) -> None:
        """Take what the pictures show; the longer side has `longest_px`."""
        places = [place for corners in footprints for place in corners]
        self.south, self.north = min(p[0] for p in places), max(p[0] for p in places)
        self.west, self.east = min(p[1] for p in places), max(p[1] for p in places)
        narrowing = math.cos(math.radians((self.south + self.north) / 2.0))
        width_m = (self.east - self.west) * METRES_PER_DEGREE * narrowing
        height_m = (self.north - self.south) * METRES_PER_DEGREE
        self.metres_per_px = max(width_m, height_m) / longest_px
        if not self.metres_per_px > 0.0:
            raise ValueError("the pictures show no ground")
        self.width = max(1, round(width_m / self.metres_per_px))
        self.height = max(1, round(height_m / self.metres_per_px))

    def point(self, place: Sequence[float]) -> Point:
        """Give the pixel of a latitude and longitude."""
        across = (place[1] - self.west) / (self.east - self.west) * self.width
        return across, (self.north - place[0]) / (self.north - self.south) * self.height

    @property
    def corners(self) -> list[tuple[float, float]]:
        """Latitude and longitude from the north-west on clockwise."""
        west, south, east, north = self.west, self.south, self.east, self.north
        return [(north, west), (north, east), (south, east), (south, west)]


def middle(corners: Sequence[Point]) -> Point:
    """Give the mean of the corners."""
    return sum(p[0] for p in corners) / len(corners), sum(p[1] for p in corners) / len(corners)


def nearest_part(corners: Sequence[Point], own: int, middles: Sequence[Point]) -> list[Point]:
    """Give the part of a picture that is nearer to its middle than to any other one."""
    part = list(corners)
    here = middles[own]
    for index, there in enumerate(middles):
        if index == own:
            continue
        if there == here:
            if index < own:
                return []  # The first of those that were taken at one place is drawn
            continue
        across, down = there[0] - here[0], there[1] - here[1]
        half = (there[0] ** 2 + there[1] ** 2 - here[0] ** 2 - here[1] ** 2) / 2.0
        part = _clipped(part, across, down, half)
        if not part:
            break
    return part


def _clipped(polygon: Sequence[Point], across: float, down: float, limit: float) -> list[Point]:
    """Keep what has `across * x + down * y <= limit` (Sutherland and Hodgman, 1974)."""
    kept = []
    for index, end in enumerate(polygon):
        begin = polygon[index - 1]
        at_begin = across * begin[0] + down * begin[1] - limit
        at_end = across * end[0] + down * end[1] - limit
        if (at_begin > 0.0) != (at_end > 0.0):
            part = at_begin / (at_begin - at_end)
            kept.append(
                (begin[0] + part * (end[0] - begin[0]), begin[1] + part * (end[1] - begin[1]))
            )
        if at_end <= 0.0:
            kept.append(end)
    return kept


def perspective(points: Sequence[Point], size: tuple[int, int]) -> list[float]:
    """Give the coefficients that lead from pixels of the map to those of a picture of this size.

    `points` are where the picture's corners lie on the map, from its top left on clockwise.
    """
    width, height = size
    corners = ((0.0, 0.0), (width, 0.0), (width, height), (0.0, height))
    rows = []
    for (x, y), (u, v) in zip(points, corners, strict=True):
        rows.append([x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y, u])
        rows.append([0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y, v])
    return _solved(rows)


def _solved(rows: list[list[float]]) -> list[float]:
    """Solve linear equations by elimination; ValueError if they have no single solution."""
    count = len(rows)
    for column in range(count):
        best = max(range(column, count), key=lambda row: abs(rows[row][column]))
        if abs(rows[best][column]) < 1e-12:
            raise ValueError("its corners lie on one line")
        rows[column], rows[best] = rows[best], rows[column]
        for row in range(count):
            if row != column and (factor := rows[row][column] / rows[column][column]):
                rows[row] = [a - factor * b for a, b in zip(rows[row], rows[column], strict=True)]
    return [rows[index][count] / rows[index][index] for index in range(count)]


class Canvas:
    """The map while pictures are laid on it."""

    def __init__(self, frame: Frame, colours: Sequence[Sequence[int]] | None = None) -> None:
        """Begin with nothing; `colours` of grey values are those that a map shows."""
        self._frame = frame
        self._colours = colours
        size = (frame.width, frame.height)
        self._others = Image.new("RGBA", size)  # Whatever shows a place
        self._nearest = Image.new("RGBA", size)  # The nearest picture alone
        self.count = 0

    def add(self, data: bytes, corners: Sequence[Point], part: Sequence[Point]) -> None:
        """Lay a picture on its corners; `part` is where it is the nearest."""
        left = max(0, math.floor(min(p[0] for p in corners)))
        top = max(0, math.floor(min(p[1] for p in corners)))
        right = min(self._frame.width, math.ceil(max(p[0] for p in corners)))
        bottom = min(self._frame.height, math.ceil(max(p[1] for p in corners)))
        if right <= left or bottom <= top:
            return
        size = right - left, bottom - top
        picture = _decoded(data, size)
        moved = [(x - left, y - top) for x, y in corners]
        coefficients = perspective(moved, picture.size)
        if self._colours is not None:
            picture = _coloured(picture.convert("L"), self._colours)
        laid = picture.transform(
            size, Image.Transform.PERSPECTIVE, coefficients, Image.Resampling.BILINEAR
        )
        for canvas, area in ((self._others, corners), (self._nearest, part)):
            if len(area) < 3:
                continue
            mask = Image.new("L", size)
            ImageDraw.Draw(mask).polygon([(x - left, y - top) for x, y in area], fill=255)
            if laid.mode == "RGBA":  # Opaque or not there: half of a value is none
                shown = laid.getchannel("A").point(lambda opacity: 255 * (opacity > 127))
                mask = ImageChops.multiply(mask, shown)
            canvas.paste(laid, (left, top), mask)
        self.count += 1

    def encoded(self) -> bytes:
        """Give the map as a WebP, transparent where no picture shows anything."""
        whole = self._others
        whole.paste(self._nearest, (0, 0), self._nearest)
        out = io.BytesIO()
        whole.save(out, "WEBP", quality=QUALITY)
        return out.getvalue()


def _decoded(data: bytes, size: tuple[int, int]) -> Image.Image:
    """Read a picture, at a fraction of its size if that is enough."""
    try:
        picture = Image.open(io.BytesIO(data), formats=FORMATS)
    except UnidentifiedImageError:  # Its text names the buffer, not the picture
        raise ValueError(f"it is no readable {', '.join(FORMATS)} picture") from None
    if picture.width * picture.height > (Image.MAX_IMAGE_PIXELS or 0):
        raise ValueError(f"it has {picture.width} x {picture.height} pixels")
    picture.draft("RGB", size)
    if picture.width * picture.height > DECODED_PIXELS:
        raise ValueError(f"it has {picture.width} x {picture.height} pixels")
    return picture.convert("RGB")


def _coloured(grey: Image.Image, colours: Sequence[Sequence[int]]) -> Image.Image:
    """Give each grey value its colour and opacity."""
    channels = [grey.point([entry[channel] for entry in colours]) for channel in range(4)]
    return Image.merge("RGBA", channels)


def _pictures(stream: BinaryIO) -> Iterator[bytes]:
    while len(size := stream.read(8)) == 8:
        yield stream.read(struct.unpack(">Q", size)[0])


def main() -> int:
    """Read stdin, write stdout; give the exit status."""
    for what, limit in ((resource.RLIMIT_AS, MEMORY_BYTES), (resource.RLIMIT_CPU, CPU_S)):
        with contextlib.suppress(ValueError):  # A lower limit is set already
            resource.setrlimit(what, (limit, limit))
    warnings.simplefilter("error", Image.DecompressionBombWarning)
    ImageFile.LOAD_TRUNCATED_IMAGES = False
    longest_px, megapixels = (int(argument) for argument in sys.argv[1:])
    Image.MAX_IMAGE_PIXELS = megapixels * 1_000_000
    stdin = sys.stdin.buffer
    try:
        header = json.loads(stdin.readline())
        footprints = header["footprints"]
        frame = Frame(footprints, longest_px)
        corners = [[frame.point(place) for place in one] for one in footprints]
        middles = [middle(one) for one in corners]
        canvas, fault = Canvas(frame, header["colours"]), ""
        for index, data in enumerate(_pictures(stdin)):
            try:
                canvas.add(data, corners[index], nearest_part(corners[index], index, middles))
            except FAILURES as error:
                fault = fault or f", the first, number {index + 1}: {error or type(error).__name__}"
        if not canvas.count:
            raise ValueError(f"no picture can be read{fault}")
        about = {
            "width": frame.width,
            "height": frame.height,
            "corners": frame.corners,
            "metres_per_px": frame.metres_per_px,
            "pictures": canvas.count,
        }
        encoded = canvas.encoded()
    except FAILURES as error:
        sys.stderr.write(f"{error or type(error).__name__}\n")
        return 1
    sys.stdout.buffer.write(json.dumps(about).encode() + b"\n" + encoded)
    return 0


if __name__ == "__main__":
    sys.exit(main())
