"""What ground the pictures of a flight show, over HTTP, by the metadata that cameras write."""

import base64
from pathlib import Path
from typing import Any

import pytest

from sim.mosaic.georeference import georeference
from tests.support.geodesy import LocalGround
from tests.unit.edge_server.archive.flown import begin, send
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import JPEG
from tests.unit.sim.camera.shots import pose, taken


def footprints(edge: Edge, *pictures: bytes) -> list[Any]:
    """Corners of the pictures of a flight with these pictures."""
    begin(edge)
    for number, data in enumerate(pictures):
        frame = base64.b64encode(data).decode()
        send(edge, "image", sequence_number=number, image_size=len(data), frame=frame)
    found = edge.get("/flights/1/footprints", "farmer")
    assert [one["id"] for one in found] == list(range(1, len(pictures) + 1))
    return [one["corners"] for one in found]


@pytest.mark.parametrize(("pitch_deg", "yaw_deg"), [(-90.0, 0.0), (-90.0, 135.0), (-75.0, 215.0)])
def test_the_ground_of_a_picture_is_that_of_mapping_software(
    edge: Edge, tmp_path: Path, pitch_deg: float, yaw_deg: float
) -> None:
    picture = taken(tmp_path, pose(5.0, 30.0, 20.0, pitch_deg, yaw_deg))
    (tmp_path / "picture.jpg").write_bytes(picture)
    survey = georeference(tmp_path / "picture.jpg")
    (corners,) = footprints(edge, picture)
    assert survey.corners is not None
    ground = LocalGround(survey.latitude_deg, survey.longitude_deg)
    for corner, expected_m in zip(corners, survey.corners, strict=True):
        assert ground.north_east_m(*corner) == pytest.approx(expected_m, abs=0.05)


def test_a_picture_that_looks_ahead_or_says_nothing_is_no_map(edge: Edge, tmp_path: Path) -> None:
    ahead = taken(tmp_path, pose(5.0, 30.0, 20.0, -30.0, 0.0))
    assert footprints(edge, ahead, JPEG) == [None, None]


def test_footprints_are_paged(edge: Edge) -> None:
    footprints(edge, JPEG, JPEG, JPEG)
    assert [one["id"] for one in edge.get("/flights/1/footprints?limit=1&after=1")] == [2]
