"""Trees of the orchard stand in their rows, and lean outward in a picture as tall things do."""

import math

import numpy as np
import pytest

from sim.camera.scene.orchard import crowns
from sim.camera.scene.reflectance import LEAF_INDEX
from sim.world.layout import FIELDS, Cover
from tests.unit.sim.camera.shots import FARM
from tests.unit.sim.camera.test_picture import shot

GROVE = next(field for field in FIELDS if field.cover is Cover.OLIVES)


def test_every_tree_stands_on_a_row_of_the_grove() -> None:
    trees = crowns(FARM.seed)
    places = {tree.middle[:2] for tree in trees}
    spacing_m2 = GROVE.row_spacing_m * GROVE.plant_spacing_m
    assert len(places) == len(trees) == pytest.approx(GROVE.area_m2 / spacing_m2, rel=0.1)
    for east, north in places:
        field = FARM.field_at(*FARM.plane.geodetic((east, north)))
        assert field is not None
        assert field.cover is Cover.OLIVES
        across = (east * GROVE.across[0] + north * GROVE.across[1]) / GROVE.row_spacing_m
        assert across == pytest.approx(round(across), abs=1e-6)


def test_crowns_are_wider_where_the_map_has_more_vigour() -> None:
    trees = sorted(crowns(FARM.seed), key=lambda tree: tree.half[0])
    indices = [
        FARM.vegetation_index(*FARM.plane.geodetic(tree.middle[:2]), 0.0)
        for tree in (trees[0], trees[-1])
    ]
    assert trees[0].half[0] < trees[-1].half[0]
    assert indices[0] < indices[1]


def test_a_crown_lies_farther_out_in_the_picture_than_its_foot() -> None:
    tree = crowns(FARM.seed)[len(crowns(FARM.seed)) // 2]
    east, north, height = tree.middle
    above_m, aside_m, width = 30.0, 12.0, 600
    image = shot(east - aside_m, north, above_m, -90.0, 0.0, width=width)
    focal_px = width * 4.5 / 6.3
    foot = 0.5 * width + focal_px * aside_m / above_m
    middle = 0.5 * width + focal_px * aside_m / (above_m - height)
    row = image.vegetation_index[image.vegetation_index.shape[0] // 2]
    reach = math.ceil(1.4 * focal_px * tree.half[0] / (above_m - height))
    leafy = np.flatnonzero(row > 127.5 * (1.0 + 0.8 * LEAF_INDEX))
    near = leafy[np.abs(leafy - middle) < reach]
    assert abs(near.mean() - middle) < abs(near.mean() - foot)


def test_from_the_side_a_tree_stands_before_the_horizon() -> None:
    tree = max(crowns(FARM.seed), key=lambda each: each.middle[0])
    east, north, height = tree.middle
    image = shot(east + 12.0, north, height, 0.0, 270.0, width=160)
    middle, above = image.colour[60, 70:90].mean(axis=0), image.colour[10, 70:90].mean(axis=0)
    assert middle[1] > middle[2]  # Leaves
    assert above[2] > above[1]  # Sky
