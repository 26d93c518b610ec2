"""What a vehicle has photographed, put together: a contact sheet, and a map of what looks down."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from sim.mosaic.contact_sheet import Print, write_contact_sheet
from sim.mosaic.folder import Sheet, pictures_in, write_mosaic
from sim.mosaic.georeference import Georeference
from sim.physics.worlds import world
from sim.world.farm import Farm
from sim.world.plane import Plane

CONTACT_SHEET: Final = "contact_sheet.jpg"
MOSAIC: Final = "mosaic.jpg"
_MOST_PRINTS: Final = 40
_DOWN_DEG: Final = -80.0
_WINDS: Final = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")


class Album(NamedTuple):
    """The pictures of one vehicle's flight."""

    vehicle_id: int
    pictures: int
    contact_sheet: Path  # Of the first forty
    mosaic: Sheet | None  # None when none of them looks down

    @property
    def sentence(self) -> str:
        """How many there are and what they show."""
        many = f"{self.pictures} picture{'s' if self.pictures != 1 else ''}"
        if self.mosaic is None:
            return many
        shares = "".join(f", {share:.1%} of the {name}" for name, share in self.mosaic.fields)
        return f"{many}, {self.mosaic.shown_ha:.2f} ha on the map{shares}"


def write_album(
    vehicle_id: int, folder: Path, out: Path, world_name: str, *, without: frozenset[str]
) -> Album | None:
    """Write the sheets of the pictures in a folder into `out`; None when there is no picture.

    Args:
        vehicle_id: whose they are.
        folder: where they lie.
        out: where the sheets go.
        world_name: names the place of the farm.
        without: names of pictures that are not meant.

    Raises:
        OSError: if a picture cannot be read or a sheet not be written.
    """
    found = [each for each in pictures_in(folder) if each.path.name not in without]
    if not found:
        return None
    place = world(world_name)
    farm = Farm(origin=Plane(place.latitude_deg, place.longitude_deg, place.altitude_amsl_m))
    write_contact_sheet(_prints(found), out / CONTACT_SHEET)
    return Album(
        vehicle_id,
        len(found),
        out / CONTACT_SHEET,
        write_mosaic(found, farm, out / MOSAIC),
    )


def _prints(pictures: Sequence[Georeference]) -> list[Print]:
    """In the order of their names, which is that of their times."""
    return [
        Print(each.path, f"{number + 1}: {each.height_m:.0f} m up, {_looks(each)}")
        for number, each in enumerate(pictures[:_MOST_PRINTS])
    ]


def _looks(picture: Georeference) -> str:
    """Destination as text."""
    if picture.pitch_deg < _DOWN_DEG:
        return "straight down"
    sector = round(picture.yaw_deg % 360.0 / 45.0) % len(_WINDS)
    return f"{picture.pitch_deg:+.0f} deg to {_WINDS[sector]}"
