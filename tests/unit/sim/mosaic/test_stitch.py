"""Survey pictures overlap as planned, and lie on one map by their EXIF alone."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from sim.camera.film.picture_file import write_picture
from sim.mosaic.folder import pictures_in, write_mosaic
from sim.mosaic.georeference import Georeference, PictureError, georeference
from sim.mosaic.stitch import Mosaic, stitch
from sim.world.layout import FIELDS
from tests.unit.sim.camera.shots import FARM, MORNING_S, order, pose
from tests.unit.sim.camera.surveyor import read

HEIGHT_M, WIDTH_PX = 30.0, 480
ACROSS_M, ALONG_M = HEIGHT_M * 6.3 / 4.5, HEIGHT_M * 4.725 / 4.5
FRONT, SIDE = 0.7, 0.5  # Planned overlaps
EAST = [-20.0 + (1.0 - SIDE) * ACROSS_M * i for i in range(3)]
NORTH = [45.0 + (1.0 - FRONT) * ALONG_M * i for i in range(5)]


@pytest.fixture(scope="module")
def survey(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three lines of five pictures over the north field, flown to and fro."""
    folder = tmp_path_factory.mktemp("survey")
    places = [
        pose(east, north, HEIGHT_M, -90.0, 0.0 if line % 2 == 0 else 180.0)
        for line, east in enumerate(EAST)
        for north in (NORTH if line % 2 == 0 else NORTH[::-1])
    ]
    for number, place in enumerate(places):
        write_picture(order(folder, number, place, width_px=WIDTH_PX, second="ndvi"))
    return folder


def in_order(folder: Path) -> list[Georeference]:
    return sorted(pictures_in(folder), key=lambda each: int(each.path.stem))


def overlap(one: Georeference, two: Georeference) -> float:
    """Share of the first picture's ground that the second one shows."""
    corners = one.corners
    assert corners is not None
    low, high = corners.min(axis=0), corners.max(axis=0)
    north, east = (low[i] + (high[i] - low[i]) * (np.arange(60) + 0.5) / 60 for i in (0, 1))
    away = one.offset_m(two.latitude_deg, two.longitude_deg)
    column, row = two.pixels(north[:, np.newaxis] + away[0], east[np.newaxis, :] + away[1])
    shown = (column > 0) & (column < two.width_px) & (row > 0) & (row < two.height_px)
    return float(shown.mean())


@pytest.mark.thorough
def test_consecutive_pictures_overlap_as_planned(survey: Path) -> None:
    pictures = in_order(survey)
    lines = [pictures[first : first + len(NORTH)] for first in range(0, len(pictures), len(NORTH))]
    for line in lines:
        for one, two in itertools.pairwise(line):
            assert overlap(one, two) == pytest.approx(FRONT, abs=0.02)
    assert overlap(pictures[0], pictures[9]) == pytest.approx(SIDE, abs=0.02)


def test_the_map_agrees_with_the_surveyor(survey: Path) -> None:
    """Two ways from a picture to the ground that share no code."""
    for picture in in_order(survey)[::4]:
        metadata, _ = read(picture.path.read_bytes())
        latitude, longitude = FARM.plane.geodetic((EAST[1], NORTH[2]))
        ground_m = metadata.altitude_m - picture.height_m
        north, east = picture.offset_m(latitude, longitude)
        column, row = picture.pixels(np.array([-north]), np.array([-east]))
        seen = metadata.pixel(latitude, longitude, ground_m)
        assert (column[0], row[0]) == pytest.approx(seen, abs=0.05)


def test_two_pictures_of_one_place_agree(survey: Path) -> None:
    """Where they overlap, the map of one is the map of the other."""
    one, two = in_order(survey)[2:4]
    both = stitch([one, two], cell_m=0.15)
    alone = [stitch([each], cell_m=0.15) for each in (one, two)]
    assert both is not None
    shared = both.count == 2
    maps = [_over(both, each).astype(float) for each in alone if each is not None]
    difference = np.abs(maps[0] - maps[1])[shared]
    shuffled = np.abs(maps[0] - np.roll(maps[1], 9, axis=1))[shared]
    assert shared.mean() > 0.5
    assert difference.mean() < 0.6 * shuffled.mean()


def _over(whole: Mosaic, part: Mosaic) -> NDArray[np.uint8]:
    """A part on the cells of the whole, to the nearest cell."""
    north, east = whole.places()
    away = (
        (whole.latitude_deg - part.latitude_deg) * 111_050.0,
        (whole.longitude_deg - part.longitude_deg) * 84_830.0,
    )
    rows = np.round((part.north_m - north - away[0]) / part.cell_m - 0.5).astype(int)
    columns = np.round((east + away[1] - part.west_m) / part.cell_m - 0.5).astype(int)
    size = part.count.shape
    found: NDArray[np.uint8] = part.colours[rows.clip(0, size[0] - 1), columns.clip(0, size[1] - 1)]
    return found


def test_the_map_of_ndvi_is_the_farms_map(survey: Path) -> None:
    mosaic = stitch(pictures_in(survey / "ndvi"), cell_m=0.25)
    assert mosaic is not None
    seen, expected = [], []
    north, east = (places.ravel() for places in mosaic.places())
    origin = FARM.plane.place(mosaic.latitude_deg, mosaic.longitude_deg)
    block = 16  # Four metres: some rows
    for row in range(0, len(north) - block, block):
        for column in range(0, len(east) - block, block):
            if not (mosaic.count[row : row + block, column : column + block] > 0).all():
                continue
            cells = mosaic.colours[row : row + block, column : column + block]
            middle = (row + block // 2, column + block // 2)
            place = FARM.plane.geodetic(
                (origin.east_m + east[middle[1]], origin.north_m + north[middle[0]])
            )
            seen.append(cells.mean() / 127.5 - 1.0)
            expected.append(FARM.vegetation_index(*place, MORNING_S))
    assert len(seen) > 150
    assert np.sqrt(np.mean((np.array(seen) - np.array(expected)) ** 2)) < 0.05
    assert np.corrcoef(seen, expected)[0, 1] > 0.8


def test_the_whole_area_is_shown_and_its_share_of_the_field_told(
    survey: Path, tmp_path: Path
) -> None:
    sheet = write_mosaic(in_order(survey), FARM, tmp_path / "map.jpg")
    assert sheet is not None
    area = ((EAST[-1] - EAST[0]) + ACROSS_M) * ((NORTH[-1] - NORTH[0]) + ALONG_M)
    assert sheet.shown_ha == pytest.approx(area * 1e-4, rel=0.02)
    shares = dict(sheet.fields)
    assert shares["North field"] == pytest.approx(area / FIELDS[0].area_m2, rel=0.05)
    assert set(shares) == {"North field"}
    with Image.open(sheet.path) as written:
        assert max(written.size) <= 2401


def test_what_is_no_picture_or_tells_no_place_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "noise.jpg").write_bytes(b"\x00" * 100)
    Image.new("RGB", (8, 8)).save(tmp_path / "plain.jpg")
    for name in ("noise.jpg", "plain.jpg"):
        with pytest.raises(PictureError, match=name):
            georeference(tmp_path / name)
    assert list(pictures_in(tmp_path)) == []


def test_pictures_of_the_horizon_make_no_map(tmp_path: Path) -> None:
    write_picture(order(tmp_path, 0, pose(0.0, 0.0, 10.0, -10.0, 0.0), width_px=64))
    assert write_mosaic(in_order(tmp_path), FARM, tmp_path / "map.jpg") is None
