"""`python -m sim.camera.views SHEET.jpg`: what the camera sees of the farm, on one sheet."""

import argparse
import math
import sys
import tempfile
from pathlib import Path
from typing import Final, NamedTuple

from PIL import Image as PillowImage

from sim.camera.picture import Shot, render
from sim.camera.scene.lens import Lens, Pose
from sim.mosaic.contact_sheet import Print, write_contact_sheet
from sim.physics.truth import quaternion_from_euler
from sim.world.farm import Farm
from sim.world.layout import FIELDS

_MORNING_S: Final = 1_780_308_000.0  # 2026-06-01 10:00 UTC
_HOUR_S: Final = 3600.0
_LENS: Final = Lens(4.5, 6.3, 4.725, 1200, 900)


class View(NamedTuple):
    """A picture of the sheet: where from, where to, when."""

    caption: str
    east_m: float
    north_m: float
    height_m: float
    pitch_deg: float
    yaw_deg: float
    hours: float = 0.0  # [h] After ten in the morning, UTC
    is_index: bool = False  # NDVI in place of colours


def _views(farm: Farm) -> list[View]:
    tractor, *cows = (each.place for each in farm.subjects(_MORNING_S))
    beside = (cows[1].east_m, cows[1].north_m)
    vines, olives = (field.boundary[2] for field in (FIELDS[1], FIELDS[3]))
    return [
        View("North field from 10 m: maize, drip lines", 20.0, 40.0, 10.0, -90.0, 0.0),
        View("The same from 60 m", 20.0, 60.0, 60.0, -90.0, 0.0),
        View("The same as NDVI", 20.0, 60.0, 60.0, -90.0, 0.0, is_index=True),
        View("Yard and slabs at home", 8.0, -4.0, 16.0, -90.0, 0.0),
        View("North over home from 30 m", 0.0, -55.0, 30.0, -30.0, 0.0),
        View("Barn and olives", -18.0, -28.0, 12.0, -18.0, 320.0),
        View("Vineyard", vines.east_m - 70.0, vines.north_m - 25.0, 15.0, -40.0, 200.0),
        View("Olive grove in the evening", olives.east_m - 55.0, 60.0, 35.0, -90.0, 0.0, 7.0),
        View("Tractor", tractor.east_m + 6.0, tractor.north_m + 6.0, 6.0, -33.0, 225.0),
        View("Cows", beside[0] + 6.0, beside[1] - 6.0, 5.0, -32.0, 315.0),
        View("Tramlines in barley", 150.0, -120.0, 40.0, -60.0, 10.0),
        View("From 120 m", 40.0, 20.0, 120.0, -55.0, 0.0),
    ]


def main() -> int:
    """Render and write."""
    parser = argparse.ArgumentParser(
        prog="sim.camera.views", description="Show what the camera sees of the farm on one sheet."
    )
    parser.add_argument("sheet", type=Path, help="JPEG to write")
    sheet: Path = parser.parse_args().sheet
    farm = Farm()
    with tempfile.TemporaryDirectory() as folder:
        prints = [
            Print(_taken(farm, view, Path(folder) / f"{number}.png"), view.caption)
            for number, view in enumerate(_views(farm))
        ]
        write_contact_sheet(prints, sheet)
    return 0


def _taken(farm: Farm, view: View, path: Path) -> Path:
    latitude_deg, longitude_deg = farm.plane.geodetic((view.east_m, view.north_m))
    q = quaternion_from_euler(0.0, math.radians(view.pitch_deg), math.radians(view.yaw_deg))
    altitude_m = farm.plane.altitude_amsl_m + view.height_m
    image = render(
        Shot(
            farm,
            Pose(latitude_deg, longitude_deg, altitude_m, q),
            _LENS,
            _MORNING_S + view.hours * _HOUR_S,
        )
    )
    pixels = image.vegetation_index if view.is_index else image.colour
    PillowImage.fromarray(pixels).save(path)
    return path


if __name__ == "__main__":
    sys.exit(main())
