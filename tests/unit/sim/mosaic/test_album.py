"""Sheets of what a vehicle has photographed."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sim.camera.film.picture_file import write_picture
from sim.mosaic.album import write_album
from sim.mosaic.contact_sheet import Print, write_contact_sheet
from sim.mosaic.georeference import Georeference
from sim.mosaic.stitch import Mosaic
from sim.world.layout import FIELDS
from tests.unit.sim.camera.shots import FARM, order, pose

SURVEY = Path(__file__).parents[4] / "examples" / "plans" / "field_survey.json"


def test_pictures_that_look_down_come_on_the_map_and_all_on_the_sheet(tmp_path: Path) -> None:
    folder = tmp_path / "image"
    for number, pitch in enumerate((-90.0, -90.0, -20.0)):
        place = pose(10.0 + 8.0 * number, 40.0, 20.0, pitch, 90.0)
        write_picture(order(folder, number, place, width_px=160))
    album = write_album(3, folder, tmp_path / "out", "farm", without=frozenset({"1.jpg"}))
    assert album is not None
    assert album.mosaic is not None
    assert (album.vehicle_id, album.pictures) == (3, 2)
    assert "2 pictures" in album.sentence
    assert "of the North field" in album.sentence
    with Image.open(album.contact_sheet) as sheet, Image.open(album.mosaic.path) as drawn:
        assert sheet.width > 2 * 320
        assert drawn.width > 100


def test_without_pictures_there_is_no_album(tmp_path: Path) -> None:
    assert write_album(1, tmp_path, tmp_path / "out", "farm", without=frozenset()) is None
    assert not (tmp_path / "out").exists()


def test_a_sheet_has_every_picture_in_its_place(tmp_path: Path) -> None:
    prints = []
    for number, colour in enumerate(((255, 0, 0), (0, 255, 0), (0, 0, 255))):
        path = tmp_path / f"{number}.png"
        Image.new("RGB", (64, 48), colour).save(path)
        prints.append(Print(path, f"number {number}"))
    write_contact_sheet(prints, tmp_path / "sheet.jpg", columns=2, width_px=100)
    with Image.open(tmp_path / "sheet.jpg") as sheet:
        pixels = np.asarray(sheet).astype(int)
    assert pixels[40, 50].argmax() == 0
    assert pixels[40, 160].argmax() == 1
    assert pixels[145, 50].argmax() == 2
    with pytest.raises(ValueError, match="none"):
        write_contact_sheet([], tmp_path / "sheet.jpg")


def test_the_example_survey_shows_the_whole_field() -> None:
    """Two hectares, each spot in at least one picture, a good half of them in two and more."""
    plan = json.loads(SURVEY.read_text())
    commands = plan["missions"][0]["command_array"]
    places = [
        command["parameters"]
        for command, following in pairwise(commands)
        if following["command_type_id"] == 4
    ]
    assert len(places) == 24
    pictures = [
        Georeference(
            SURVEY, at["latitude"], at["longitude"], 650.0 + at["altitude"], at["altitude"],
            0.0, -90.0, 0.0, 2048 * 4.5 / 6.3, 2048, 1536,
        )
        for at in places
    ]  # fmt: skip
    field = FIELDS[0]
    assert field.area_m2 > 20_000.0
    count = np.zeros((400, 400), dtype=np.uint16)
    whole = Mosaic(*_home(), 150.0, -100.0, 0.5, np.zeros((1, 1, 3), dtype=np.uint8), count)
    north, east = whole.places()
    for each in pictures:
        away = each.offset_m(*_home())
        column, row = each.pixels(north - away[0], east - away[1])
        count += (column > 0) & (column < 2048) & (row > 0) & (row < 1536)
    assert whole.covered([(p.north_m, p.east_m) for p in field.boundary]) >= 0.999
    assert (count > 1).sum() > 0.5 * (count > 0).sum()


def _home() -> tuple[float, float]:
    return FARM.plane.latitude_deg, FARM.plane.longitude_deg
