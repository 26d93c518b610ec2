"""Satellite receivers of the simulation, by name: their errors, and the accuracy that they report.

The position error of a receiver is the sum of two Gauss-Markov processes and white noise: what
changes with satellites and atmosphere, over minutes, what reflections do, over half a minute,
and what changes from fix to fix. Its velocity comes from the carrier's Doppler shift, knows
nothing of these, and is white.

| name | class | position, one sigma |
|---|---|---|
| `m9n` | u-blox NEO-M9N: one band, no corrections | 1.0 m an axis, 1.8 m down |
| `rtk` | u-blox ZED-F9P: two bands, RTK fixed | 0.02 m an axis, 0.03 m down |

Data sheets: M9N 1.5 m CEP; F9P 0.01 m + 1 ppm CEP; velocity of both 0.05 m/s.
The M9N's sheet is for a day under a weak sky; 1.0 m, 1.2 m CEP, is an open field. Errors along
the vertical are larger by the usual ratio of dilutions, VDOP over HDOP. Measured positions of
single-band receivers lose their correlation with one time of about a minute and another one of
tens of minutes (D. L. Wilson, "Correlation of Errors", gpsinformation.net).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, TypeAlias

PerAxis: TypeAlias = tuple[float, float, float]
"""Standard deviations north, east, down."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GnssReceiver:
    """Errors of one receiver, standard deviations north, east, down."""

    slow_sigma_ned_m: PerAxis  # [m] Gauss-Markov: satellites and atmosphere
    slow_time_s: float  # [s] Its correlation time
    multipath_sigma_ned_m: PerAxis  # [m] Gauss-Markov: reflections
    multipath_time_s: float  # [s]
    white_sigma_ned_m: PerAxis  # [m] From fix to fix
    velocity_sigma_ned_m_s: PerAxis  # [m/s] White
    fix_type: int  # [-] MAVLink GPS_FIX_TYPE of a good solution

    @property
    def position_sigma_ned_m(self) -> PerAxis:
        """All of the position error [m], each axis."""
        north, east, down = (
            math.hypot(slow, multipath, white)
            for slow, multipath, white in zip(
                self.slow_sigma_ned_m,
                self.multipath_sigma_ned_m,
                self.white_sigma_ned_m,
                strict=True,
            )
        )
        return (north, east, down)


_VELOCITY: Final[PerAxis] = (0.05, 0.05, 0.08)

GNSS_RECEIVERS: Final[Mapping[str, GnssReceiver]] = MappingProxyType(
    {
        "m9n": GnssReceiver(
            slow_sigma_ned_m=(0.9, 0.9, 1.6),
            slow_time_s=600.0,
            multipath_sigma_ned_m=(0.4, 0.4, 0.8),
            multipath_time_s=30.0,
            white_sigma_ned_m=(0.05, 0.05, 0.10),
            velocity_sigma_ned_m_s=_VELOCITY,
            fix_type=3,
        ),
        "rtk": GnssReceiver(
            slow_sigma_ned_m=(0.012, 0.012, 0.020),
            slow_time_s=300.0,
            multipath_sigma_ned_m=(0.010, 0.010, 0.015),
            multipath_time_s=30.0,
            white_sigma_ned_m=(0.010, 0.010, 0.015),
            velocity_sigma_ned_m_s=_VELOCITY,
            fix_type=6,
        ),
    }
)
"""Receivers by the name that SimulationConfig.gps and GPS take."""
