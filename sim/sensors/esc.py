"""Telemetry of the speed controllers: rotor speed and current of each motor.

As an ESC with bidirectional DShot reports it: the period of the electrical revolution in 9 bits
of mantissa and 3 of exponent, so that the speed is known to about half a percent (one sigma
0.3 %), and a shunt with 0.2 A of noise. The flight controller asks 125 times a second.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np

from sim.physics.noise import standard_normals
from sim.physics.truth import Motors, Truth
from sim.sensors.readings import EscReading

RATE_HZ: Final = 125
SPEED_SIGMA: Final = 0.003
CURRENT_SIGMA_A: Final = 0.2


class EscTelemetry:
    """`factor` scales every error alike."""

    def __init__(self, generator: np.random.Generator, *, factor: float) -> None:
        self._normals: Iterator[float] = standard_normals(generator)
        self._speed_sigma = SPEED_SIGMA * factor
        self._current_sigma_a = CURRENT_SIGMA_A * factor

    def read(self, truth: Truth, current_a: Motors) -> EscReading:
        """One report of all four."""
        return EscReading(truth.time_us, self._rpm(truth.rotor_rpm), self._current(current_a))

    def _rpm(self, true_rpm: Motors) -> Motors:
        normals, sigma = self._normals, self._speed_sigma
        one, two, three, four = true_rpm
        return (
            one * (1.0 + sigma * next(normals)),
            two * (1.0 + sigma * next(normals)),
            three * (1.0 + sigma * next(normals)),
            four * (1.0 + sigma * next(normals)),
        )

    def _current(self, true_a: Motors) -> Motors:
        normals, sigma = self._normals, self._current_sigma_a
        one, two, three, four = true_a
        one += sigma * next(normals)
        two += sigma * next(normals)
        three += sigma * next(normals)
        four += sigma * next(normals)
        if one >= 0.0 and two >= 0.0 and three >= 0.0 and four >= 0.0:  # The usual case
            return (one, two, three, four)
        return (max(0.0, one), max(0.0, two), max(0.0, three), max(0.0, four))
