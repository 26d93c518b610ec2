"""The Earth's magnetic field after the World Magnetic Model 2025 (WMM2025).

Spherical harmonics of degree 12 with linear change over the years 2025 to 2030: Chulliat et
al., "The US/UK World Magnetic Model for 2025-2030", NOAA NCEI and British Geological Survey,
2024, equations 1 to 18; the coefficients are those of its file WMM2025.COF, in the public
domain. The Legendre functions are Schmidt semi-normalised, built by the recursions

    P(n,n) = sqrt((2n - 1) / (2n)) sin(t) P(n-1,n-1)
    P(n,m) = ((2n - 1) cos(t) P(n-1,m) - sqrt((n - 1)^2 - m^2) P(n-2,m)) / sqrt(n^2 - m^2)

of the geocentric colatitude t (Winch et al., Geophysical Journal International 160, 2005).
"""

import math
from datetime import UTC, datetime
from typing import Final, NamedTuple

from sim.physics.earth import ECCENTRICITY_SQUARED, SEMI_MAJOR_AXIS_M
from sim.physics.truth import Vector3

_REFERENCE_RADIUS_M: Final = 6_371_200.0
_DEGREE: Final = 12
_EPOCH_YEAR: Final = 2025.0
_LAST_YEAR: Final = 2030.0
_NANOTESLA_PER_GAUSS: Final = 1e5
_LEAST_SINE: Final = 1e-8  # The poles themselves have no east


class _Term(NamedTuple):
    """Gauss coefficients [nT] of a degree and an order, and their change [nT/year]."""

    degree: int
    order: int
    g: float
    h: float
    g_rate: float
    h_rate: float


def decimal_year(time_utc_us: int) -> float:
    """Year with fraction of a time [us since 1970], held within the model's five years."""
    seconds = min(max(time_utc_us // 1_000_000, 0), 4_102_444_800)
    moment = datetime.fromtimestamp(seconds, UTC)
    start = datetime(moment.year, 1, 1, tzinfo=UTC)
    length = datetime(moment.year + 1, 1, 1, tzinfo=UTC) - start
    year = moment.year + (moment - start) / length
    return min(max(year, _EPOCH_YEAR), _LAST_YEAR)


def field_ned_gauss(
    latitude_deg: float, longitude_deg: float, altitude_m: float, year: float
) -> Vector3:
    """Field [gauss] north, east and down at a place on WGS-84 in a decimal year."""
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    colatitude, radius_m = _geocentric(latitude, altitude_m)
    north, east, down = _spherical_field_nt(colatitude, longitude, radius_m, year - _EPOCH_YEAR)
    # From the sphere's north and down to the ellipsoid's
    turn = (0.5 * math.pi - colatitude) - latitude
    sine, cosine = math.sin(turn), math.cos(turn)
    scale = 1.0 / _NANOTESLA_PER_GAUSS
    return (
        (north * cosine - down * sine) * scale,
        east * scale,
        (north * sine + down * cosine) * scale,
    )


def _geocentric(latitude: float, altitude_m: float) -> tuple[float, float]:
    """Geocentric colatitude [rad] and radius [m] of a geodetic latitude [rad] and height [m]."""
    sine, cosine = math.sin(latitude), math.cos(latitude)
    normal_m = SEMI_MAJOR_AXIS_M / math.sqrt(1.0 - ECCENTRICITY_SQUARED * sine * sine)
    from_axis_m = (normal_m + altitude_m) * cosine
    above_equator_m = (normal_m * (1.0 - ECCENTRICITY_SQUARED) + altitude_m) * sine
    return math.atan2(from_axis_m, above_equator_m), math.hypot(from_axis_m, above_equator_m)


def _spherical_field_nt(
    colatitude: float, longitude: float, radius_m: float, years: float
) -> Vector3:
    """Minus the gradient of the potential: north, east, down of the sphere [nT]."""
    cosine = math.cos(colatitude)
    sine = max(math.sin(colatitude), _LEAST_SINE)
    legendre = _legendre(cosine, sine)
    north = east = down = 0.0
    for term in _TERMS:
        degree, order = term.degree, term.order
        power = (_REFERENCE_RADIUS_M / radius_m) ** (degree + 2)
        g, h = term.g + years * term.g_rate, term.h + years * term.h_rate
        along, across = math.cos(order * longitude), math.sin(order * longitude)
        value = legendre[degree][order]
        wave = g * along + h * across
        north += power * wave * _slope(legendre, degree, order, cosine, sine)
        east += power * order * (g * across - h * along) * value / sine
        down -= power * (degree + 1) * wave * value
    return north, east, down


def _slope(
    legendre: list[list[float]], degree: int, order: int, cosine: float, sine: float
) -> float:
    """Derivative by the colatitude of P(degree, order)."""
    lower = legendre[degree - 1][order] if order < degree else 0.0
    root = math.sqrt(degree * degree - order * order)
    return (degree * cosine * legendre[degree][order] - root * lower) / sine


def _legendre(cosine: float, sine: float) -> list[list[float]]:
    """P(n,m) for n up to the model's degree."""
    table = [[1.0], [cosine, sine]]
    for n in range(2, _DEGREE + 1):
        row = []
        for m in range(n):
            before = table[n - 2][m] if m < n - 1 else 0.0
            root = math.sqrt((n - 1) ** 2 - m * m)
            row.append(
                ((2 * n - 1) * cosine * table[n - 1][m] - root * before) / math.sqrt(n * n - m * m)
            )
        row.append(math.sqrt((2 * n - 1) / (2 * n)) * sine * table[n - 1][n - 1])
        table.append(row)
    return table


_TERMS: Final = tuple(
    _Term(*row)
    for row in (
        (1, 0, -29351.8, 0.0, 12.0, 0.0),
        (1, 1, -1410.8, 4545.4, 9.7, -21.5),
        (2, 0, -2556.6, 0.0, -11.6, 0.0),
        (2, 1, 2951.1, -3133.6, -5.2, -27.7),
        (2, 2, 1649.3, -815.1, -8.0, -12.1),
        (3, 0, 1361.0, 0.0, -1.3, 0.0),
        (3, 1, -2404.1, -56.6, -4.2, 4.0),
        (3, 2, 1243.8, 237.5, 0.4, -0.3),
        (3, 3, 453.6, -549.5, -15.6, -4.1),
        (4, 0, 895.0, 0.0, -1.6, 0.0),
        (4, 1, 799.5, 278.6, -2.4, -1.1),
        (4, 2, 55.7, -133.9, -6.0, 4.1),
        (4, 3, -281.1, 212.0, 5.6, 1.6),
        (4, 4, 12.1, -375.6, -7.0, -4.4),
        (5, 0, -233.2, 0.0, 0.6, 0.0),
        (5, 1, 368.9, 45.4, 1.4, -0.5),
        (5, 2, 187.2, 220.2, 0.0, 2.2),
        (5, 3, -138.7, -122.9, 0.6, 0.4),
        (5, 4, -142.0, 43.0, 2.2, 1.7),
        (5, 5, 20.9, 106.1, 0.9, 1.9),
        (6, 0, 64.4, 0.0, -0.2, 0.0),
        (6, 1, 63.8, -18.4, -0.4, 0.3),
        (6, 2, 76.9, 16.8, 0.9, -1.6),
        (6, 3, -115.7, 48.8, 1.2, -0.4),
        (6, 4, -40.9, -59.8, -0.9, 0.9),
        (6, 5, 14.9, 10.9, 0.3, 0.7),
        (6, 6, -60.7, 72.7, 0.9, 0.9),
        (7, 0, 79.5, 0.0, 0.0, 0.0),
        (7, 1, -77.0, -48.9, -0.1, 0.6),
        (7, 2, -8.8, -14.4, -0.1, 0.5),
        (7, 3, 59.3, -1.0, 0.5, -0.8),
        (7, 4, 15.8, 23.4, -0.1, 0.0),
        (7, 5, 2.5, -7.4, -0.8, -1.0),
        (7, 6, -11.1, -25.1, -0.8, 0.6),
        (7, 7, 14.2, -2.3, 0.8, -0.2),
        (8, 0, 23.2, 0.0, -0.1, 0.0),
        (8, 1, 10.8, 7.1, 0.2, -0.2),
        (8, 2, -17.5, -12.6, 0.0, 0.5),
        (8, 3, 2.0, 11.4, 0.5, -0.4),
        (8, 4, -21.7, -9.7, -0.1, 0.4),
        (8, 5, 16.9, 12.7, 0.3, -0.5),
        (8, 6, 15.0, 0.7, 0.2, -0.6),
        (8, 7, -16.8, -5.2, 0.0, 0.3),
        (8, 8, 0.9, 3.9, 0.2, 0.2),
        (9, 0, 4.6, 0.0, 0.0, 0.0),
        (9, 1, 7.8, -24.8, -0.1, -0.3),
        (9, 2, 3.0, 12.2, 0.1, 0.3),
        (9, 3, -0.2, 8.3, 0.3, -0.3),
        (9, 4, -2.5, -3.3, -0.3, 0.3),
        (9, 5, -13.1, -5.2, 0.0, 0.2),
        (9, 6, 2.4, 7.2, 0.3, -0.1),
        (9, 7, 8.6, -0.6, -0.1, -0.2),
        (9, 8, -8.7, 0.8, 0.1, 0.4),
        (9, 9, -12.9, 10.0, -0.1, 0.1),
        (10, 0, -1.3, 0.0, 0.1, 0.0),
        (10, 1, -6.4, 3.3, 0.0, 0.0),
        (10, 2, 0.2, 0.0, 0.1, 0.0),
        (10, 3, 2.0, 2.4, 0.1, -0.2),
        (10, 4, -1.0, 5.3, 0.0, 0.1),
        (10, 5, -0.6, -9.1, -0.3, -0.1),
        (10, 6, -0.9, 0.4, 0.0, 0.1),
        (10, 7, 1.5, -4.2, -0.1, 0.0),
        (10, 8, 0.9, -3.8, -0.1, -0.1),
        (10, 9, -2.7, 0.9, 0.0, 0.2),
        (10, 10, -3.9, -9.1, 0.0, 0.0),
        (11, 0, 2.9, 0.0, 0.0, 0.0),
        (11, 1, -1.5, 0.0, 0.0, 0.0),
        (11, 2, -2.5, 2.9, 0.0, 0.1),
        (11, 3, 2.4, -0.6, 0.0, 0.0),
        (11, 4, -0.6, 0.2, 0.0, 0.1),
        (11, 5, -0.1, 0.5, -0.1, 0.0),
        (11, 6, -0.6, -0.3, 0.0, 0.0),
        (11, 7, -0.1, -1.2, 0.0, 0.1),
        (11, 8, 1.1, -1.7, -0.1, 0.0),
        (11, 9, -1.0, -2.9, -0.1, 0.0),
        (11, 10, -0.2, -1.8, -0.1, 0.0),
        (11, 11, 2.6, -2.3, -0.1, 0.0),
        (12, 0, -2.0, 0.0, 0.0, 0.0),
        (12, 1, -0.2, -1.3, 0.0, 0.0),
        (12, 2, 0.3, 0.7, 0.0, 0.0),
        (12, 3, 1.2, 1.0, 0.0, -0.1),
        (12, 4, -1.3, -1.4, 0.0, 0.1),
        (12, 5, 0.6, 0.0, 0.0, 0.0),
        (12, 6, 0.6, 0.6, 0.1, 0.0),
        (12, 7, 0.5, -0.1, 0.0, 0.0),
        (12, 8, -0.1, 0.8, 0.0, 0.0),
        (12, 9, -0.4, 0.1, 0.0, 0.0),
        (12, 10, -0.2, -1.0, -0.1, 0.0),
        (12, 11, -1.3, 0.1, 0.0, 0.0),
        (12, 12, -0.7, 0.2, -0.1, -0.1),
    )
)
