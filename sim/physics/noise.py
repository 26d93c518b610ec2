"""Random processes that sensor errors are made of, drawn in blocks from seeded generators.

Every instrument has a generator of its own, spawned from one seed by its name's place in
`STREAMS`, so that a change in one instrument leaves the noise of the others as it was.
"""

import math
from collections.abc import Iterator
from itertools import chain
from typing import Final

import numpy as np

from sim.physics.truth import Vector3

STREAMS: Final = (
    "imu",
    "baro",
    "magnetometer",
    "gps",
    "battery",
    "wind",
    "esc",
    "rangefinder",
    "environment",
    "imu_1",
    "imu_2",
    "baro_1",
    "baro_2",
    "magnetometer_1",
    "magnetometer_2",
)
"""Append only: the position of a name decides its random numbers."""

_BLOCK: Final = 1024  # Drawn one by one a normal number costs three times as much


def generators(seed: int) -> dict[str, np.random.Generator]:
    """One independent generator per stream, all from one seed (numpy's SeedSequence)."""
    children = np.random.SeedSequence(seed).spawn(len(STREAMS))
    return {
        name: np.random.Generator(np.random.PCG64(child))
        for name, child in zip(STREAMS, children, strict=True)
    }


def standard_normals(generator: np.random.Generator) -> Iterator[float]:
    """Independent normal numbers of mean 0 and variance 1, without end."""

    def block() -> list[float]:
        numbers: list[float] = generator.standard_normal(_BLOCK).tolist()
        return numbers

    # The pieces are put together outside of the interpreter, which costs a quarter less.
    return chain.from_iterable(iter(block, []))


def white_sigma(density: float, rate_hz: float) -> float:
    """Standard deviation of a sample of white noise of one-sided `density` [unit/sqrt(Hz)].

    Sampled at `rate_hz` behind an ideal anti-alias filter of half that bandwidth, the
    variance is density squared times rate over two.
    """
    return density * math.sqrt(0.5 * rate_hz)


class GaussMarkov:
    """First-order Gauss-Markov process, dx/dt = -x/tau + w, in its stationary state.

    Discretised exactly: x[k+1] = a x[k] + sigma sqrt(1 - a^2) n with a = exp(-dt/tau)
    (Brown and Hwang, Introduction to Random Signals and Applied Kalman Filtering, 3.6).
    """

    __slots__ = ("_decay", "_drive", "_normals", "value")

    def __init__(
        self, normals: Iterator[float], *, sigma: float, correlation_time_s: float, step_s: float
    ) -> None:
        self._normals = normals
        self._decay = math.exp(-step_s / correlation_time_s)
        self._drive = sigma * math.sqrt(1.0 - self._decay * self._decay)
        self.value = sigma * next(normals)

    def step(self) -> float:
        """Value one step later."""
        self.value = self._decay * self.value + self._drive * next(self._normals)
        return self.value


def normal_vector(normals: Iterator[float], sigma: float) -> Vector3:
    """Three independent components of standard deviation `sigma`."""
    return (sigma * next(normals), sigma * next(normals), sigma * next(normals))
