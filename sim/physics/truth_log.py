"""The true track as CSV, one row every 20 ms or less of simulated time.

Rows reach the operating system at least once a simulated second, so that a killed process
loses no more than that. The same seed gives the same bytes.
"""

import sys
from pathlib import Path
from typing import Final

from sim.physics.truth import Truth

RATE_HZ: Final = 50

COLUMNS: Final = (
    "time_s",
    "latitude_deg",
    "longitude_deg",
    "altitude_amsl_m",
    "height_above_home_m",
    "velocity_north_m_s",
    "velocity_east_m_s",
    "velocity_down_m_s",
    "q_w",
    "q_x",
    "q_y",
    "q_z",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
    "rotor_1_rpm",
    "rotor_2_rpm",
    "rotor_3_rpm",
    "rotor_4_rpm",
)

_ROW: Final = (
    "%.6f,%.9f,%.9f,%.4f,%.4f,%.4f,%.4f,%.4f,%.7f,%.7f,%.7f,%.7f,%.4f,%.4f,%.4f,"
    "%.1f,%.1f,%.1f,%.1f\n"
)


class TruthLog:
    """An open log file; missing folders are made.

    A medium that refuses later on ends the log, not the flight.

    Raises:
        OSError: if the file cannot be created.
    """

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("w", encoding="ascii", newline="\n")
        self._file.write(",".join(COLUMNS) + "\n")
        self._file.flush()
        self._period_us = 1_000_000 // RATE_HZ
        self._next_us = 0
        self._rows = 0
        self._ended = False

    def record(self, truth: Truth) -> None:
        """Write a row if one is due."""
        if truth.time_us < self._next_us or self._ended:
            return
        self._next_us += self._period_us
        self._rows += 1
        try:
            self._file.write(format_row(truth))
            if self._rows % RATE_HZ == 0:
                self._file.flush()
        except OSError as error:
            self._end(error)

    def close(self) -> None:
        """Write what is left and close the file; a second call does nothing."""
        try:
            self._file.close()
        except OSError as error:
            self._end(error)

    def _end(self, error: OSError) -> None:
        """Write no more, and say why once."""
        if not self._ended:
            sys.stderr.write(f"Truth log ended: {error.strerror or error}\n")
        self._ended = True


def format_row(truth: Truth) -> str:
    """One line in the order of `COLUMNS`.

    Nine decimals of a degree are a tenth of a millimetre.
    """
    return _ROW % (
        truth.time_us * 1e-6,
        truth.latitude_deg,
        truth.longitude_deg,
        truth.altitude_amsl_m,
        truth.height_above_home_m,
        *truth.velocity_ned,
        *truth.q_ned_frd,
        truth.roll_deg,
        truth.pitch_deg,
        truth.yaw_deg,
        *truth.rotor_rpm,
    )
