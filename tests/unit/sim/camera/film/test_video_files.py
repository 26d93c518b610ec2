"""Frames become a film of the farm as the camera saw it."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sim.camera.film.orders import Frame, from_line, to_line
from sim.camera.film.video_files import VideoFiles
from tests.unit.sim.camera.film.test_motion_jpeg import played
from tests.unit.sim.camera.shots import lens, order, pose


def frame(folder: Path, number: int, north_m: float = 0.0, *, is_end: bool = False) -> Frame:
    seen = order(folder, number, pose(0.0, north_m, 20.0, -90.0, 0.0))
    return Frame(
        number=number,
        farm_seed=seen.farm_seed,
        farm_origin=seen.farm_origin,
        farm_time_s=seen.farm_time_s,
        pose=seen.pose,
        lens=lens(160),
        path=str(folder / "film.avi"),
        rate_hz=5.0,
        is_end=is_end,
    )


def test_a_film_shows_what_moves_past_below(tmp_path: Path) -> None:
    files = VideoFiles()
    for number in range(3):
        files.take(frame(tmp_path, number, 30.0 * number))
    files.take(frame(tmp_path, 3, is_end=True))
    _, jpegs = played((tmp_path / "film.avi").read_bytes())
    pictures = [np.asarray(Image.open(io.BytesIO(jpeg))).astype(float) for jpeg in jpegs]
    assert [picture.shape for picture in pictures] == [(120, 160, 3)] * 3
    assert np.abs(pictures[0] - pictures[1]).mean() > 3.0


def test_where_a_frame_is_missing_the_one_before_it_stands(tmp_path: Path) -> None:
    files = VideoFiles()
    shown = [frame(tmp_path, number, 30.0 * number) for number in range(2)]
    grown = [
        files.take(shown[0]),
        files.take(replace(shown[1], place=3)),
        files.take(replace(shown[1], place=6, is_end=True)),
    ]
    content = (tmp_path / "film.avi").read_bytes()
    _, jpegs = played(content)
    assert jpegs == [jpegs[0]] * 3 + [jpegs[3]] * 3
    assert jpegs[0] != jpegs[3]
    assert 0 <= len(content) - sum(each.size_bytes for each in grown) < 400


def test_every_byte_is_counted(tmp_path: Path) -> None:
    files = VideoFiles()
    first, second, end = (
        files.take(frame(tmp_path, number, is_end=number == 2)) for number in range(3)
    )
    assert (first.files, second.files, end.files) == (1, 0, 0)
    size = (tmp_path / "film.avi").stat().st_size
    assert 0 <= size - sum(part.size_bytes for part in (first, second, end)) < 400


def test_a_film_that_exists_is_not_written_over(tmp_path: Path) -> None:
    (tmp_path / "film.avi").write_bytes(b"earlier")
    with pytest.raises(OSError, match=r"film\.avi"):
        VideoFiles().take(frame(tmp_path, 0))
    assert (tmp_path / "film.avi").read_bytes() == b"earlier"


def test_what_is_left_open_is_ended(tmp_path: Path) -> None:
    files = VideoFiles()
    files.take(frame(tmp_path, 0))
    files.close()
    lists, jpegs = played((tmp_path / "film.avi").read_bytes())
    assert len(jpegs) == 1
    assert "idx1" in lists


def test_a_frame_survives_the_way_to_the_studio(tmp_path: Path) -> None:
    seen = frame(tmp_path, 7)
    assert from_line(to_line(seen)) == seen
    assert from_line(to_line(replace(seen, is_end=True))) == replace(seen, is_end=True)
