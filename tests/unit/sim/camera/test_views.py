"""The command that shows the farm on one sheet."""

import sys
from pathlib import Path

import pytest
from PIL import Image

import sim.camera.views
from tests.unit.sim.camera.shots import lens


def test_the_sheet_of_the_farm_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sheet = tmp_path / "pictures" / "sheet.jpg"
    monkeypatch.setattr(sys, "argv", ["views", str(sheet)])
    monkeypatch.setattr(sim.camera.views, "_LENS", lens(48))
    assert sim.camera.views.main() == 0
    with Image.open(sheet) as written:
        assert written.width > 4 * 320
        assert written.height > 3 * 240
