"""The fine structure of the ground: one random texture, repeated, at the scale that a pixel sees.

White noise is given a spectrum that falls with frequency, as that of foliage and soil does (Field
1987, Journal of the Optical Society of America A 4), and averaged into coarser and coarser levels
so that a far pixel sees the mean of what lies in it.
"""

from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.camera.scene.lens import Pixels

_SIZE: Final = 1024  # Cells along an edge; a power of two
_CELL_M: Final = 0.012
_SLOPE: Final = 0.9
_FEWEST_WAVES: Final = 5  # Along an edge: what is longer would show that the texture repeats
_COARSER: Final = 8.7  # The texture is laid a second time, so much larger, for what is longer
_FINE_SHARE, _COARSE_SHARE = 0.87, 0.5  # Squares add to 1
_TURN: Final = (0.8, 0.6)  # Cosine and sine of the second layer's turn
_FAR_M: Final = 65_536 * _CELL_M  # Makes every coordinate of the farm positive


class Level(NamedTuple):
    """The texture in cells of one size."""

    cell_m: float  # [m]
    values: NDArray[np.float32]  # [-] Mean 0; the finest level has variance 1


@cache
def levels(seed: int) -> tuple[Level, ...]:
    """The texture of a farm, finest first."""
    random = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, 1 << 16])))
    white = np.fft.rfft2(random.standard_normal((_SIZE, _SIZE)))
    down, right = np.fft.fftfreq(_SIZE)[:, np.newaxis], np.fft.rfftfreq(_SIZE)[np.newaxis, :]
    frequency = np.hypot(down, right) * _SIZE
    frequency[0, 0] = 1.0
    white[frequency < _FEWEST_WAVES] = 0.0
    values = np.fft.irfft2(white / frequency**_SLOPE, s=(_SIZE, _SIZE))
    found = [Level(_CELL_M, (values / values.std()).astype(np.float32))]
    while found[-1].values.shape[0] > 2:
        finer = found[-1].values
        coarser = 0.25 * (finer[::2, ::2] + finer[1::2, ::2] + finer[::2, 1::2] + finer[1::2, 1::2])
        found.append(Level(2.0 * found[-1].cell_m, coarser))
    return tuple(found)


def grain(seed: int, east_m: Pixels, north_m: Pixels, cell_m: float) -> Pixels:
    """The texture at places of the map, averaged over about `cell_m`."""
    cosine, sine = (np.float32(part / _COARSER) for part in _TURN)
    coarse = _looked_up(
        seed, cosine * east_m - sine * north_m, sine * east_m + cosine * north_m, cell_m / _COARSER
    )
    fine = _looked_up(seed, east_m, north_m, cell_m)
    both: Pixels = np.float32(_FINE_SHARE) * fine + np.float32(_COARSE_SHARE) * coarse
    return both


def _looked_up(seed: int, east_m: Pixels, north_m: Pixels, cell_m: float) -> Pixels:
    chosen = next((lv for lv in levels(seed) if lv.cell_m >= cell_m), levels(seed)[-1])
    mask = np.int32(chosen.values.shape[0] - 1)
    far, per_metre = np.float32(_FAR_M), np.float32(1.0 / chosen.cell_m)
    column = ((east_m + far) * per_metre).astype(np.int32) & mask
    row = ((north_m + far) * per_metre).astype(np.int32) & mask
    values: Pixels = chosen.values[row, column]
    return values
