"""Magnetic declination by place: a table ten degrees wide, straight in between.

The values are those of the World Magnetic Model 2025 (NOAA NCEI and British Geological Survey)
at sea level in mid 2027, the middle of its five years. Between 45 degrees south and 60 north the
straight lines are within 0.12 degrees of the model at every other place, within 0.6 at nineteen of
twenty and within 2 everywhere, which the compass error of two degrees that the estimator reckons
with covers; near the magnetic poles no compass is of use.
"""

import math
from typing import Final

_STEP_DEG: Final = 10.0
_SOUTHERNMOST_DEG: Final = -80.0
_ROWS: Final = 17
_COLUMNS: Final = 36


def declination(latitude_deg: float, longitude_deg: float) -> float:
    """Declination [rad], east positive, at a place on WGS-84 [deg].

    Beyond 80 degrees of latitude the value there is given.
    """
    row = (latitude_deg - _SOUTHERNMOST_DEG) / _STEP_DEG
    row = min(max(row, 0.0), _ROWS - 1.0)
    south = min(int(row), _ROWS - 2)
    column = ((longitude_deg + 180.0) % 360.0) / _STEP_DEG
    west = int(column) % _COLUMNS
    east = (west + 1) % _COLUMNS
    up, right = row - south, column - math.floor(column)
    corners = (
        ((1.0 - up) * (1.0 - right), _TENTHS[south][west]),
        ((1.0 - up) * right, _TENTHS[south][east]),
        (up * (1.0 - right), _TENTHS[south + 1][west]),
        (up * right, _TENTHS[south + 1][east]),
    )
    # Directions are averaged, not numbers: near the magnetic poles they go round the circle
    x = sum((weight * math.cos(math.radians(0.1 * tenths)) for weight, tenths in corners), 0.0)
    y = sum((weight * math.sin(math.radians(0.1 * tenths)) for weight, tenths in corners), 0.0)
    return math.atan2(y, x)


# Tenths of a degree; two lines a row, from 80 degrees south to 80 north; columns from 180 west
# to 170 east
_TABLE: Final = """
1283 1161 1051 950 856 769 685 604 526 448 372 297 222 148 73 -3 -80 -159
-240 -323 -409 -498 -589 -682 -778 -877 -980 -1087 -1202 -1324 -1455 -1595 -1742 1707 1558 1415
859 779 713 658 607 559 510 458 403 345 283 221 160 100 42 -16 -76 -139
-209 -285 -365 -448 -532 -615 -697 -779 -861 -947 -1042 -1154 -1303 -1527 1732 1369 1121 965
490 474 457 440 424 408 389 364 327 279 222 158 95 38 -11 -53 -95 -144
-203 -274 -353 -433 -509 -579 -640 -691 -731 -759 -768 -741 -615 -169 309 455 494 499
320 321 317 311 306 303 300 292 271 231 172 99 23 -41 -88 -117 -138 -165
-209 -273 -348 -423 -488 -539 -571 -582 -568 -521 -431 -293 -126 31 150 231 281 308
230 235 235 232 228 226 226 224 213 180 119 35 -53 -125 -169 -190 -198 -202
-218 -260 -322 -385 -434 -461 -463 -437 -382 -301 -202 -106 -25 44 103 153 191 216
173 178 179 178 175 170 166 164 155 125 62 -27 -117 -185 -222 -237 -238 -225
-204 -203 -233 -277 -313 -328 -315 -277 -219 -150 -83 -31 6 39 75 110 140 161
136 138 139 139 136 130 124 120 110 78 13 -74 -157 -213 -237 -240 -225 -192
-145 -107 -99 -123 -158 -180 -177 -152 -114 -68 -26 0 13 29 54 83 108 126
113 112 110 110 108 103 97 92 79 44 -20 -101 -171 -213 -223 -205 -170 -126
-79 -40 -18 -24 -51 -78 -86 -78 -59 -30 -4 8 9 16 38 64 88 106
100 98 94 93 92 89 83 76 60 21 -42 -113 -170 -198 -192 -160 -115 -72
-37 -9 13 17 -1 -24 -36 -38 -30 -15 0 3 -2 1 21 48 73 93
92 91 88 89 90 88 81 70 47 4 -57 -118 -162 -177 -160 -123 -78 -40
-12 8 25 32 21 3 -9 -14 -14 -9 -4 -8 -18 -18 -1 27 56 80
80 88 91 96 101 100 91 74 42 -9 -69 -122 -153 -156 -133 -97 -57 -21
3 19 33 40 33 19 9 3 -2 -5 -10 -22 -38 -42 -29 -2 30 60
61 81 96 108 118 119 108 84 42 -17 -80 -128 -149 -142 -118 -84 -46 -12
12 28 41 48 45 37 29 22 13 1 -15 -38 -60 -70 -61 -36 -3 32
39 71 99 122 136 139 128 98 46 -23 -92 -138 -154 -144 -117 -83 -46 -11
17 36 50 60 65 64 60 51 35 11 -20 -55 -86 -100 -93 -69 -36 2
19 61 100 132 153 160 148 112 49 -34 -111 -161 -176 -164 -135 -98 -58 -19
15 42 65 84 99 108 108 97 70 28 -24 -75 -113 -129 -122 -98 -63 -23
4 52 97 137 167 180 169 126 45 -60 -153 -206 -220 -206 -173 -131 -85 -38
7 49 88 122 152 174 182 169 130 63 -18 -93 -141 -158 -149 -123 -86 -43
-17 35 85 130 166 183 172 115 2 -136 -241 -289 -292 -267 -225 -173 -116 -56
4 64 122 176 225 264 288 288 249 159 29 -92 -166 -191 -184 -156 -115 -68
-86 -35 12 50 72 66 14 -95 -233 -339 -388 -390 -361 -315 -257 -192 -122 -49
26 101 176 249 319 385 443 489 510 485 363 104 -132 -231 -248 -227 -187 -138
"""
_NUMBERS: Final = tuple(int(number) for number in _TABLE.split())
_TENTHS: Final = tuple(_NUMBERS[row * _COLUMNS : (row + 1) * _COLUMNS] for row in range(_ROWS))
