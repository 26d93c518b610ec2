"""The true track, read from a truth log and laid on a plane."""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from sim.physics.earth import degrees_per_metre
from sim.physics.truth_log import COLUMNS
from sim.report.arrays import Array, ReportError

_ROWS_MIN: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Plane:
    """North, east and up [m] about a place; good to a centimetre over a farm."""

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float  # of height zero

    def place(self, latitude_deg: Array, longitude_deg: Array) -> Array:
        """North and east [m], a row per place."""
        scale = degrees_per_metre(self.latitude_deg, self.altitude_amsl_m)
        return np.stack(
            (
                (np.asarray(latitude_deg) - self.latitude_deg) / scale.north,
                (np.asarray(longitude_deg) - self.longitude_deg) / scale.east,
            ),
            axis=-1,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthTrack:
    """True states of the simulator, a row per instant."""

    plane: Plane  # about where the vehicle stood first, height zero on the ground there
    time_s: Array  # since boot
    position: Array  # [m] north, east, up
    velocity_ned: Array  # [m/s]
    q_ned_frd: Array


def read_truth(path: Path) -> TruthTrack:
    """Read a truth log; a last line that was cut off is left out.

    Raises:
        ReportError: if there is no such log or next to nothing in it.
    """
    try:
        with path.open(newline="", encoding="ascii") as log:
            rows = [row for row in csv.reader(log) if len(row) == len(COLUMNS)][1:]
            table = np.array([[float(cell) for cell in row] for row in rows])
    except (OSError, ValueError) as error:
        raise ReportError(f"{path} holds no truth log: {error}") from None
    if len(table) < _ROWS_MIN:
        raise ReportError(f"{path} holds no flight")
    column = {name: table[:, number] for number, name in enumerate(COLUMNS)}
    height = column["height_above_home_m"]
    plane = Plane(
        latitude_deg=float(column["latitude_deg"][0]),
        longitude_deg=float(column["longitude_deg"][0]),
        altitude_amsl_m=float(column["altitude_amsl_m"][0] - height[0]),
    )
    ground = plane.place(column["latitude_deg"], column["longitude_deg"])
    return TruthTrack(
        plane=plane,
        time_s=column["time_s"],
        position=np.column_stack((ground, height)),
        velocity_ned=_columns(
            column, "velocity_north_m_s", "velocity_east_m_s", "velocity_down_m_s"
        ),
        q_ned_frd=_columns(column, "q_w", "q_x", "q_y", "q_z"),
    )


def _columns(column: dict[str, Array], *names: str) -> Array:
    return np.stack([column[name] for name in names], axis=1)
