"""The covariance of the error state: prediction and fusion, with sums in an order that is fixed.

Two classes do the same arithmetic, to the last bit as long as every number is finite:
`covariance_arrays` in whole arrays of numpy, for the interpreter, and `covariance_kernel` in plain
loops, which `make compile` turns into C. Products go through no BLAS: it sums in an order, and
rounds in places, that depend on the processor.

The matrix stays exactly symmetric: only the upper triangle of a prediction counts, and a fusion
subtracts the square of one vector.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from farm_flight_bridge.native import mypyc_attr
from uav_firmware.lib.rotation import Matrix3
from uav_firmware.msg.vectors import Vector3

Array = NDArray[np.float64]

MOVED: Final = 9
"""Errors that a prediction moves: position, velocity and attitude, the first ones of the state."""
_ZERO3: Final[Vector3] = (0.0, 0.0, 0.0)


@mypyc_attr(acyclic=True, free_list_len=1)
class Measurement:
    """One scalar measurement, linearised at the present estimate."""

    __slots__ = ("innovation", "jacobian", "variance")

    def __init__(
        self,
        innovation: float,  # Measured minus expected
        jacobian: tuple[float, ...],  # Row H of length SIZE: change of the expectation per error
        variance: float,  # Of the measurement noise
    ) -> None:
        self.innovation: Final = innovation
        self.jacobian: Final = jacobian
        self.variance: Final = variance


@mypyc_attr(acyclic=True, free_list_len=1)
class Transition:
    """How errors move on over an interval; SI."""

    __slots__ = ("elapsed", "impulse_ned", "kept", "rotation")

    def __init__(
        self,
        elapsed: float,  # [s]
        impulse_ned: Vector3,  # [m/s] Integral of the specific force
        rotation: Matrix3,  # [-] Body to NED, row by row
        kept: float,  # [-] Share of the slow error of GPS height that is left
    ) -> None:
        self.elapsed: Final = elapsed
        self.impulse_ned: Final = impulse_ned
        self.rotation: Final = rotation
        self.kept: Final = kept


def jacobian(
    *,
    position: Vector3 = _ZERO3,
    velocity: Vector3 = _ZERO3,
    attitude: Vector3 = _ZERO3,
    accel_bias: Vector3 = _ZERO3,
    baro_bias: float = 0.0,
    heading_bias: float = 0.0,
    gps_height_bias: float = 0.0,
    wind: tuple[float, float] = (0.0, 0.0),
) -> tuple[float, ...]:
    """Row of a measurement in the order of the error state; no sensor measures a gyro's bias."""
    px, py, pz = position
    vx, vy, vz = velocity
    rx, ry, rz = attitude
    ax, ay, az = accel_bias
    north, east = wind
    return (
        *(px, py, pz, vx, vy, vz, rx, ry, rz, ax, ay, az, 0.0, 0.0, 0.0),
        *(baro_bias, heading_bias, gps_height_bias, north, east),
    )


class Covariance(ABC):
    """A symmetric matrix of SIZE rows, [SI^2] of the errors in the order of `state`."""

    @abstractmethod
    def matrix(self) -> Array:
        """A copy of the whole."""

    @abstractmethod
    def replace(self, matrix: Array) -> None:
        """Take over a symmetric matrix."""

    @abstractmethod
    def variances(self) -> list[float]:
        """Diagonal."""

    @abstractmethod
    def variance(self, index: int) -> float:
        """Variance of one error."""

    @abstractmethod
    def set_noise(self, added: Sequence[float]) -> None:
        """Let every prediction from now on add these variances."""

    @abstractmethod
    def predict(self, transition: Transition) -> None:
        """F P F' + Q, with F as in Sola 2017, section 7.2.

        A tilt turns the impulse, velocity by its vector product; biases enter in body axes.
        """

    @abstractmethod
    def expected(self, row: tuple[float, ...]) -> float:
        """Variance of what a measurement would be, its noise left out: H P H'."""

    @abstractmethod
    def fuse(self, measurements: Sequence[Measurement]) -> list[float]:
        """Take in one scalar after the other (Sola 2017, eq. 274 to 276); gives the error found.

        The gain is s / v with s = H P and v = s H' + V; P loses s s' / v. A variance v that is not
        positive comes from a broken covariance, and its measurement is left out.
        """
