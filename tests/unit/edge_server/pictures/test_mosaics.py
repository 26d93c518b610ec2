"""Pictures become one map: each place has the picture whose middle is nearest."""

import io
import threading
from collections.abc import Sequence

import pytest
from PIL import Image

from edge_server.pictures import mosaics
from edge_server.pictures.index_colours import colours_of_grey
from edge_server.pictures.mosaics import MapKey, Mosaic, MosaicWork, lay_out
from edge_server.pictures.program import BusyError, UnreadableError
from tests.support.polling import wait_until

SIDE_DEG = 0.001
RED, GREEN, BLUE = (200, 40, 40), (40, 160, 40), (40, 40, 200)
Colour = tuple[int, int, int]
Place = tuple[float, float]


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mosaics, "LONGEST_SIDE_PX", 400)


def picture(*halves: Colour) -> bytes:
    """A picture of one colour, or of one above the other."""
    whole = Image.new("RGB", (120, 120), halves[0])
    whole.paste(halves[-1], (0, 60, 120, 120))
    out = io.BytesIO()
    whole.save(out, "JPEG", quality=95)
    return out.getvalue()


def square(latitude: float, longitude: float, side: float = SIDE_DEG) -> list[Place]:
    """A picture's corners on the ground, its top to the north."""
    half = side / 2.0
    north, south, west, east = (
        *(latitude + half, latitude - half),
        *(longitude - half, longitude + half),
    )
    return [(north, west), (north, east), (south, east), (south, west)]


def map_of(footprints: Sequence[Sequence[Place]], pictures: Sequence[bytes]) -> Mosaic:
    return lay_out(footprints, lambda index: pictures[index])


def colour_at(mosaic: Mosaic, latitude: float, longitude: float) -> Colour | None:
    """The nearest of the test's colours at a place; None where the map is transparent."""
    image = Image.open(io.BytesIO(mosaic.data)).convert("RGBA")
    (north, west), _, (south, east), _ = mosaic.about["corners"]
    x = (longitude - west) / (east - west) * image.width
    y = (north - latitude) / (north - south) * image.height
    pixel = image.getpixel((min(int(x), image.width - 1), min(int(y), image.height - 1)))
    assert isinstance(pixel, tuple)
    if pixel[3] == 0:
        return None
    return min(
        (RED, GREEN, BLUE),
        key=lambda one: sum(abs(a - b) for a, b in zip(one, pixel[:3], strict=True)),
    )


def test_each_place_has_the_picture_whose_middle_is_nearest() -> None:
    step = SIDE_DEG / 2.0
    footprints = [square(0.0, index * step) for index in range(3)]
    mosaic = map_of(footprints, [picture(RED), picture(GREEN), picture(BLUE)])
    assert mosaic.about["pictures"] == 3
    seen = [colour_at(mosaic, 0.0, part * step) for part in (-0.8, 0.4, 0.6, 1.4, 1.6, 2.8)]
    assert seen == [RED, RED, GREEN, GREEN, BLUE, BLUE]


def test_the_order_of_the_pictures_does_not_matter() -> None:
    step = SIDE_DEG / 2.0
    footprints = [square(0.0, index * step) for index in (2, 0, 1)]
    mosaic = map_of(footprints, [picture(BLUE), picture(RED), picture(GREEN)])
    seen = [colour_at(mosaic, 0.0, part * step) for part in (0.4, 0.6, 1.4, 1.6)]
    assert seen == [RED, GREEN, GREEN, BLUE]


def test_a_picture_is_turned_to_the_north() -> None:
    top_to_the_south = [square(0.0, 0.0)[index] for index in (2, 3, 0, 1)]
    mosaic = map_of([top_to_the_south, square(0.0, 0.01)], [picture(RED, BLUE), picture(GREEN)])
    assert colour_at(mosaic, SIDE_DEG / 4.0, 0.0) == BLUE
    assert colour_at(mosaic, -SIDE_DEG / 4.0, 0.0) == RED


def test_between_pictures_the_map_is_transparent() -> None:
    mosaic = map_of([square(0.0, 0.0), square(0.0, 0.005)], [picture(RED), picture(GREEN)])
    assert colour_at(mosaic, 0.0, 0.0025) is None
    assert mosaic.about["width"] == 400
    assert mosaic.about["metres_per_px"] == pytest.approx(0.006 * 111_319.49 / 400, rel=1e-6)


def test_another_picture_fills_where_the_nearest_shows_nothing() -> None:
    wide, narrow = square(0.0, 0.0, 4 * SIDE_DEG), square(0.0, SIDE_DEG, SIDE_DEG)
    mosaic = map_of([wide, narrow], [picture(RED), picture(GREEN)])
    assert colour_at(mosaic, 0.0, SIDE_DEG) == GREEN
    assert colour_at(mosaic, 0.0, 1.8 * SIDE_DEG) == RED  # Nearer to the narrow one


def test_pictures_of_one_place_need_no_turn() -> None:
    mosaic = map_of([square(0.0, 0.0)] * 2, [picture(RED), picture(GREEN)])
    assert colour_at(mosaic, 0.0, 0.0) == RED


def test_what_cannot_be_read_is_left_out() -> None:
    footprints = [square(0.0, 0.0), square(0.0, SIDE_DEG / 2.0)]
    mosaic = map_of(footprints, [picture(RED), b"no picture"])
    assert mosaic.about["pictures"] == 1
    assert colour_at(mosaic, 0.0, SIDE_DEG / 4.0 * 0.9) == RED


@pytest.mark.parametrize(
    ("footprints", "reason"),
    [
        (
            [square(0.0, 0.0), square(0.0, 0.01)],
            "no picture can be read, the first, number 1: it is no readable JPEG, PNG, ",
        ),
        ([[(1.0, 1.0)] * 4] * 2, "no ground"),
    ],
)
def test_nothing_to_show_is_named(footprints: list[list[Place]], reason: str) -> None:
    with pytest.raises(UnreadableError, match=reason):
        map_of(footprints, [b"x", b"y"])


def grey(*halves: int) -> bytes:
    """A picture of one grey value, or of one above the other."""
    return picture(*((value, value, value) for value in halves))


def test_a_vegetation_index_has_the_colours_of_the_legend_and_no_sky() -> None:
    """Of bare soil (0.0), dense leaves (1.0), and where there is no ground."""
    footprints = [square(0.0, 0.0), square(0.0, 0.01)]
    pictures = [grey(128, 255), grey(0, 128)]
    mosaic = lay_out(footprints, lambda index: pictures[index], colours=colours_of_grey())
    image = Image.open(io.BytesIO(mosaic.data)).convert("RGBA")
    x, last = image.height // 2, image.width - image.height // 2
    assert image.getpixel((x, image.height // 4)) == pytest.approx((165, 0, 38, 255), abs=12)
    below = image.getpixel((x, image.height * 3 // 4))
    assert below == pytest.approx((26, 152, 80, 255), abs=12)
    above = image.getpixel((last, image.height // 4))
    assert isinstance(above, tuple)
    assert above[3] == 0
    assert image.getpixel((last, image.height * 3 // 4)) == pytest.approx((165, 0, 38, 255), abs=12)


def test_a_map_has_a_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mosaics, "TIMEOUT_S", 0.2)
    ended = threading.Event()

    def read(_: int) -> bytes:
        ended.wait(1.0)
        return picture(RED)

    with pytest.raises(UnreadableError, match="ended"):
        lay_out([square(0.0, 0.0)] * 2, read)


def test_one_map_is_made_at_a_time_and_a_failure_is_kept() -> None:
    work, go_on = MosaicWork(), threading.Event()

    def fail() -> None:
        assert go_on.wait(30.0)
        raise UnreadableError("no map can be made")

    first, second = MapKey(1, "rgb"), MapKey(1, "ndvi")
    work.begin(first, fail)
    assert work.is_making(first)
    with pytest.raises(BusyError):
        work.begin(second, fail)
    go_on.set()
    wait_until(lambda: not work.is_making(first))
    assert work.failure(first) == "no map can be made"
    assert work.failure(second) is None
    work.begin(first, lambda: None)
    wait_until(lambda: not work.is_making(first))
    assert work.failure(first) is None
