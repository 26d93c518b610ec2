"""A smooth random map: the same numbers for the same seed, everywhere on the plane."""

import math
from enum import IntEnum
from typing import Final

import numpy as np

from sim.world.plane import Array

_WAVES: Final = 12
_SHORTEST_M, _LONGEST_M = 35.0, 220.0
_ROUGHNESS: Final = 0.8  # Amplitude grows with this power of the wavelength


class Layer(IntEnum):
    """What a map is of; each has random numbers of its own. Append only."""

    MOISTURE = 0
    VIGOUR = 1
    AIR = 2
    RELIEF = 3
    HUMIDITY = 4


class SmoothMap:
    """A sum of plane waves of random direction and phase, 35 to 220 m long.

    Values have mean 0 and variance 1 over a large area and never leave -5 to 5; the slope
    stays below 0.4 per metre.
    """

    def __init__(self, seed: int, layer: Layer) -> None:
        random = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, int(layer)])))
        steps = (np.arange(_WAVES) + random.random(_WAVES)) / _WAVES
        wavelengths = _SHORTEST_M * (_LONGEST_M / _SHORTEST_M) ** steps
        directions = 2.0 * math.pi * random.random(_WAVES)
        self._phases: Array = 2.0 * math.pi * random.random(_WAVES)
        amplitudes = wavelengths**_ROUGHNESS
        self._amplitudes: Array = amplitudes * math.sqrt(2.0 / np.sum(amplitudes**2))
        self._east: Array = 2.0 * math.pi / wavelengths * np.sin(directions)
        self._north: Array = 2.0 * math.pi / wavelengths * np.cos(directions)

    def at(self, east_m: float, north_m: float) -> float:
        """Value at a place of the plane [m]."""
        angles = self._east * east_m + self._north * north_m + self._phases
        return float(self._amplitudes @ np.cos(angles))

    def over(self, east_m: Array, north_m: Array) -> Array:
        """Values at many places [m]."""
        total = np.zeros(np.broadcast(east_m, north_m).shape)
        waves = zip(self._amplitudes, self._east, self._north, self._phases, strict=True)
        for amplitude, east, north, phase in waves:
            total += amplitude * np.cos(east * east_m + north * north_m + phase)
        return total
