"""`python -m sim.mosaic`: a folder of pictures becomes a map."""

import sys
from pathlib import Path

import pytest

import sim.mosaic.__main__
from sim.camera.film.picture_file import write_picture
from tests.unit.sim.camera.shots import order, pose


def test_a_folder_of_pictures_becomes_a_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_picture(order(tmp_path / "image", 0, pose(20.0, 60.0, 30.0, -90.0, 0.0), width_px=160))
    drawn = tmp_path / "map.jpg"
    monkeypatch.setattr(sys, "argv", ["mosaic", str(tmp_path / "image"), str(drawn)])
    assert sim.mosaic.__main__.main() == 0
    assert "1 picture, 0.13 ha" in capsys.readouterr().out
    assert drawn.stat().st_size > 1000
    monkeypatch.setattr(sys, "argv", ["mosaic", str(tmp_path), str(drawn)])
    assert sim.mosaic.__main__.main() == 1
    assert "looks down" in capsys.readouterr().err
