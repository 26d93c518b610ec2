"""Buildings and trees hide what is behind them, as the picture shows it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.camera.picture import Shot, render
from sim.camera.scene.lens import Lens, Pose
from sim.camera.scene.occlusion import share_in_sight
from sim.camera.scene.orchard import crowns
from sim.physics.truth import quaternion_from_euler
from sim.world.layout import BUILDINGS, TREES
from sim.world.plane import Place
from sim.world.subjects import Kind, Subject
from tests.unit.sim.camera.shots import FARM

BARN = BUILDINGS[0].middle
"""Eighteen metres from west to east, nine from south to north, five high."""


def tractor(east_m: float, north_m: float, heading_deg: float = 90.0) -> Subject:
    place = Place(east_m, north_m)
    return Subject("tractor", Kind.TRACTOR, place, heading_deg, 2.5, 4.2, 2.0, 2.7)


def behind_the_barn() -> Subject:
    return tractor(BARN.east_m, BARN.north_m + 8.0)


def test_behind_a_barn_nothing_is_seen_from_low_and_all_from_above() -> None:
    subject = behind_the_barn()
    south = BARN.east_m, BARN.north_m - 30.0
    assert share_in_sight(FARM, (*south, 3.0), subject) == 0.0
    assert share_in_sight(FARM, (*south, 80.0), subject) == 1.0


def test_in_front_of_the_barn_everything_is_seen() -> None:
    south = BARN.east_m, BARN.north_m - 30.0, 3.0
    assert share_in_sight(FARM, south, tractor(BARN.east_m, BARN.north_m - 8.0)) == 1.0
    assert share_in_sight(FARM, south, tractor(BARN.east_m + 60.0, BARN.north_m + 20.0)) == 1.0


def test_climbing_never_hides_more_of_what_is_behind_the_barn() -> None:
    south, subject = (BARN.east_m, BARN.north_m - 30.0), behind_the_barn()
    shares = [share_in_sight(FARM, (*south, float(height)), subject) for height in range(1, 60)]
    assert shares == sorted(shares)
    assert any(0.0 < share < 1.0 for share in shares)


def test_a_tree_hides_what_stands_close_behind_its_crown() -> None:
    tree = TREES[0]
    east, north = tree.middle
    subject = tractor(east, north + tree.radius_m + 1.5)
    assert share_in_sight(FARM, (east, north - 12.0, 0.6 * tree.height_m), subject) < 0.5
    assert share_in_sight(FARM, (east, north + 18.0, 0.6 * tree.height_m), subject) == 1.0


def test_an_olive_hides_what_passes_behind_the_grove() -> None:
    olive = max(crowns(FARM.seed), key=lambda crown: crown.middle[0])
    east, north, height = olive.middle
    subject = tractor(east + olive.half[0] + 1.0, north, heading_deg=0.0)
    assert share_in_sight(FARM, (east - 15.0, north, height), subject) < 0.5
    assert share_in_sight(FARM, (east + 25.0, north, height), subject) == 1.0


@given(st.floats(-200.0, 200.0), st.floats(-200.0, 200.0), st.floats(0.5, 100.0))
def test_it_is_a_share_from_wherever_one_looks(east: float, north: float, height: float) -> None:
    assert 0.0 <= share_in_sight(FARM, (east, north, height), behind_the_barn()) <= 1.0


@pytest.mark.parametrize("height_m", [4.0, 40.0])
def test_what_it_says_is_what_the_picture_shows(height_m: float) -> None:
    farm = FARM
    time_s = next(
        float(time)
        for time in range(1_780_308_000, 1_780_308_600)
        if math.dist(farm.subjects(float(time))[0].place, (BARN.east_m, 5.5)) < 2.0
    )
    subject = farm.subjects(time_s)[0]
    east, north = subject.place.east_m, BARN.north_m - 20.0
    pitch = -math.degrees(math.atan2(height_m - 1.3, subject.place.north_m - north))
    q = quaternion_from_euler(0.0, math.radians(pitch), 0.0)
    latitude, longitude = farm.plane.geodetic((east, north))
    pose = Pose(latitude, longitude, farm.plane.altitude_amsl_m + height_m, q)
    picture = render(Shot(farm, pose, Lens(4.5, 6.3, 4.725, 160, 120), time_s)).colour
    centre = picture[50:70, 60:100].astype(np.int64)
    red, green = centre[..., 0], centre[..., 1]
    shows_green = bool((green > red + 40).any())
    assert shows_green is (share_in_sight(FARM, (east, north, height_m), subject) >= 0.5)
