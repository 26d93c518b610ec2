"""What a picture shows: shadows, sky, rows, subjects, vegetation."""

import math

import numpy as np
import pytest

from sim.camera.picture import Image, Shot, render
from sim.world.layout import FIELDS, TREES
from tests.unit.sim.camera.shots import FARM, MORNING_S, lens, pose

HOUR_S = 3600.0


def shot(
    east: float, north: float, up: float, pitch: float, yaw: float, *, width: int = 400,
    time_s: float = MORNING_S,
) -> Image:  # fmt: skip
    return render(Shot(FARM, pose(east, north, up, pitch, yaw), lens(width), time_s))


@pytest.mark.parametrize("hours", [-2.0, 0.0, 3.0, 6.0])
def test_a_tree_throws_its_shadow_away_from_the_sun(hours: float) -> None:
    tree, time_s = TREES[2], MORNING_S + hours * HOUR_S
    image = shot(tree.middle.east_m, tree.middle.north_m, 22.0, -90.0, 0.0, time_s=time_s)
    rows, columns = np.nonzero(image.colour[:, :, 1] < 92)
    near = np.hypot(columns - 200, rows - 150) < 130
    east, north = np.mean(columns[near]) - 199.5, 149.5 - np.mean(rows[near])
    away_deg = math.degrees(math.atan2(east, north)) - FARM.sun(time_s).azimuth_deg - 180.0
    assert math.hypot(east, north) > 5.0
    assert abs((away_deg + 180.0) % 360.0 - 180.0) < 15.0


def test_a_low_sun_throws_longer_shadows() -> None:
    tree = TREES[2]
    dark = []
    for hours in (2.0, 7.5):  # Noon, evening
        image = shot(
            *tree.middle, 25.0, -90.0, 0.0, time_s=MORNING_S + hours * HOUR_S
        )  # fmt: skip
        dark.append(np.count_nonzero(image.colour[:, :, 1] < 92))
    assert dark[1] > 1.3 * dark[0]


def test_rows_run_along_their_bearing() -> None:
    """Seen with the rows' own yaw, columns of the picture differ and rows do not."""
    maize = FIELDS[0]
    taken = shot(20.0, 60.0, 12.0, -90.0, maize.row_bearing_deg, width=600)
    image = taken.vegetation_index.astype(np.float64)
    assert np.std(image.mean(axis=0)) > 4.0 * np.std(image.mean(axis=1))
    spectrum = np.abs(np.fft.rfft(image.mean(axis=0) - image.mean()))
    across_m = 12.0 * 6.3 / 4.5
    rows = across_m / maize.row_spacing_m
    assert abs(int(np.argmax(spectrum)) - rows) < 1.5


def test_the_sky_is_above_the_horizon_and_blue() -> None:
    image = shot(0.0, 0.0, 10.0, 0.0, 90.0)
    sky = image.colour[:140].reshape(-1, 3).mean(axis=0)
    ground = image.colour[170:].reshape(-1, 3).mean(axis=0)
    assert sky[2] > sky[1] > sky[0]
    assert ground[2] < ground[0]
    assert not image.vegetation_index[:100].any()


@pytest.mark.first_case
@pytest.mark.parametrize("yaw", [0.0, 77.0, 200.0])
def test_the_hills_stand_on_the_horizon_as_high_as_the_map_says(yaw: float) -> None:
    """Their outline against the sky, found by walking over the farm's elevations."""
    image = shot(30.0, -40.0, 10.0, 0.0, yaw, width=400)
    focal_px = 400 * 4.5 / 6.3
    for column in (20, 120, 199, 310, 380):
        aside = (column + 0.5 - 200) / focal_px
        bearing = math.radians(yaw) + math.atan(aside)
        rises = [
            (FARM.elevation_amsl_m(*FARM.plane.geodetic(_from_here(bearing, away))) - 660.0) / away
            for away in np.geomspace(50.0, 8000.0, 160)
        ]
        expected = 149.5 - focal_px * max(rises) * math.hypot(1.0, aside)
        ground = np.nonzero(image.near_infrared[:, column])[0]
        assert ground[0] == pytest.approx(expected, abs=2.0)
    assert image.near_infrared[:, 200].any()


def _from_here(bearing: float, away_m: float) -> tuple[float, float]:
    return 30.0 + away_m * math.sin(bearing), -40.0 + away_m * math.cos(bearing)


def test_the_tractor_is_in_the_picture_where_it_is() -> None:
    tractor = FARM.subjects(MORNING_S)[0]
    image = shot(*tractor.place, 8.0, -90.0, 0.0)
    without = shot(*tractor.place, 8.0, -90.0, 0.0, time_s=MORNING_S + 60.0)
    changed = np.abs(image.colour.astype(int) - without.colour.astype(int)).sum(axis=2) > 60
    rows, columns = np.nonzero(changed)
    assert 2_000 < changed.sum() < 60_000
    assert np.median(columns) == pytest.approx(200, abs=45)
    assert np.median(rows) == pytest.approx(150, abs=45)


def test_a_cow_stands_in_the_pasture() -> None:
    cow = FARM.subjects(MORNING_S)[2]
    image = shot(*cow.place, 6.0, -90.0, 0.0, width=300)
    index = image.vegetation_index
    middle, rim = index[90:135, 130:170].mean(), index[:30].mean()
    assert middle < rim - 15.0


@pytest.mark.first_case
@pytest.mark.parametrize("field", FIELDS, ids=lambda field: field.name)
def test_the_mean_of_ndvi_is_the_farms_own(field: object) -> None:
    boundary = next(each.boundary for each in FIELDS if each is field)
    middle = np.mean(boundary, axis=0)
    image = shot(middle[0], middle[1], 30.0, -90.0, 0.0, width=600)
    seen = image.vegetation_index.mean() / 127.5 - 1.0
    places = [
        FARM.plane.geodetic((middle[0] + east, middle[1] + north))
        for east in np.linspace(-20.0, 20.0, 9)
        for north in np.linspace(-15.0, 15.0, 7)
    ]
    expected = np.mean([FARM.vegetation_index(*place, MORNING_S) for place in places])
    assert seen == pytest.approx(expected, abs=0.05)


def test_the_same_shot_is_the_same_picture_in_every_band() -> None:
    one, two = shot(10.0, 30.0, 15.0, -60.0, 33.0), shot(10.0, 30.0, 15.0, -60.0, 33.0)
    for first, second in zip(one, two, strict=True):
        assert np.array_equal(first, second)


def test_on_the_ground_and_underneath_it_there_still_is_a_picture() -> None:
    for up in (0.15, 0.0, -3.0):
        assert shot(0.0, 0.0, up, -90.0, 0.0, width=64).colour.shape == (48, 64, 3)


def test_night_is_a_dark_picture_and_dusk_a_bright_one() -> None:
    place = pose(20.0, 40.0, 10.0, -60.0, 0.0)
    day, dusk, night = (
        render(Shot(FARM, place, lens(64), MORNING_S + hours * HOUR_S))
        for hours in (0.0, 9.65, 14.0)
    )
    assert -2.0 < FARM.sun(MORNING_S + 9.65 * HOUR_S).elevation_deg < 0.0
    assert dusk.colour.mean() > 0.7 * day.colour.mean()
    assert 0.0 < night.colour.mean() < 0.2 * day.colour.mean()
    assert night.colour.std() > 0.0
    assert night.vegetation_index.mean() == pytest.approx(day.vegetation_index.mean(), abs=5.0)
