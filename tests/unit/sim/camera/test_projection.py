"""A point of known position is where a surveyor finds it from EXIF and XMP alone.

The marks are the white slabs of the yard, 1.2 m square and 3 m apart: the brightest things there.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from sim.world.layout import PAD_HALF_M, PADS
from tests.unit.sim.camera.shots import FARM, ORIGIN, pose, taken
from tests.unit.sim.camera.surveyor import Survey, read

LOOKS = [
    pytest.param(12.0, 0.0, 14.0, -90.0, 0.0, id="straight down"),
    pytest.param(12.0, 0.0, 14.0, -90.0, 130.0, id="straight down, turned"),
    pytest.param(12.0, 0.0, 25.0, -90.0, 275.0, id="straight down from higher"),
    pytest.param(12.0, -14.0, 12.0, -42.0, 0.0, id="to the north"),
    pytest.param(30.0, 8.0, 12.0, -45.0, 250.0, id="to the west-south-west"),
    pytest.param(12.0, 12.0, 9.0, -40.0, 170.0, id="to the south"),
]


def marks(survey: Survey) -> Iterator[list[tuple[float, float]]]:
    """Corners [px] of the slabs that lie well inside the picture."""
    for pad in PADS:
        corners = [
            survey.pixel(*FARM.plane.geodetic((pad[0] + e, pad[1] + n)), ORIGIN[2])
            for e in (-PAD_HALF_M, PAD_HALF_M)
            for n in (-PAD_HALF_M, PAD_HALF_M)
        ]
        if None in corners:
            continue
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        margin = 0.5 * (high - low)
        size = (survey.width_px, survey.height_px)
        if (low - margin >= 0.0).all() and (high + margin <= size).all():
            yield corners


def white_extent(
    pixels: NDArray[np.uint8], corners: list[tuple[float, float]]
) -> list[tuple[float, float]]:
    """First and last column, first and last row of what is white about four corners [px]."""
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    margin = 0.35 * (high - low)  # The next slab is farther off
    (left, top), (right, bottom) = np.round(low - margin), np.round(high + margin)
    window = pixels[int(top) : int(bottom), int(left) : int(right)].min(axis=2) > 224
    rows, columns = np.nonzero(window)
    return [
        (left + columns.min(), left + columns.max() + 1),
        (top + rows.min(), top + rows.max() + 1),
    ]


@pytest.mark.first_case
@pytest.mark.parametrize(("east", "north", "up", "pitch", "yaw"), LOOKS)
def test_a_known_point_is_within_two_pixels(
    tmp_path: Path, east: float, north: float, up: float, pitch: float, yaw: float
) -> None:
    survey, pixels = read(taken(tmp_path, pose(east, north, up, pitch, yaw), width_px=1600))
    assert survey.pitch_deg == pytest.approx(pitch, abs=0.01)
    found = list(marks(survey))
    assert len(found) >= 2
    for corners in found:
        for axis, (first, last) in enumerate(white_extent(pixels, corners)):
            expected = [corner[axis] for corner in corners]
            assert first == pytest.approx(min(expected), abs=2.0)
            assert last == pytest.approx(max(expected), abs=2.0)


def test_the_surveyor_looks_where_the_signs_say() -> None:
    """Direction before magnitude: north is up with yaw 0, east is up with yaw 90."""

    def looking(yaw_deg: float, pitch_deg: float) -> Survey:
        return Survey(*ORIGIN[:2], 670.0, yaw_deg, pitch_deg, 0.0, 800.0, 1600, 1200)

    north = (ORIGIN[0] + 5e-5, ORIGIN[1], ORIGIN[2])
    east = (ORIGIN[0], ORIGIN[1] + 5e-5, ORIGIN[2])
    down = looking(0.0, -90.0)
    assert down.pixel(*north)[1] < 600 - 50
    assert down.pixel(*east)[0] > 800 + 50
    turned = looking(90.0, -90.0)
    assert turned.pixel(*east)[1] < 600 - 50
    ahead = looking(0.0, -30.0)
    assert ahead.pixel(ORIGIN[0] + 3e-4, ORIGIN[1], ORIGIN[2]) == pytest.approx((800, 600), abs=60)
