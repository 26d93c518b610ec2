"""The covariance in whole arrays, for the interpreter: see `covariance`.

A call of numpy costs more than what it computes here, and a loop in the interpreter more than
both. Sums run along the first axis: along the last one numpy adds in another order.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from uav_firmware.modules.estimator.kalman_filter.covariance import (
    MOVED,
    Array,
    Covariance,
    Measurement,
    Transition,
)
from uav_firmware.modules.estimator.kalman_filter.state import (
    ACCEL_BIAS,
    ATTITUDE,
    GPS_HEIGHT_BIAS,
    GYRO_BIAS,
    POSITION,
    SIZE,
    VELOCITY,
)

_TERMS: Final = 7
"""Errors of which the next value of one is made up, at most: entries in a row of F."""


def _movers() -> list[list[int]]:
    """Which they are, for each row in their order; a row that has fewer repeats its own error."""
    rows = []
    for axis in range(3):
        position, velocity, tilt = POSITION.start + axis, VELOCITY.start + axis, ATTITUDE.start
        turning = [tilt + other for other in range(3) if other != axis]
        rows.append([position, velocity, *turning, *range(ACCEL_BIAS.start, ACCEL_BIAS.stop)])
    for axis in range(3):
        velocity, tilt = VELOCITY.start + axis, ATTITUDE.start
        turning = [tilt + other for other in range(3) if other != axis]
        rows.append([velocity, *turning, *range(ACCEL_BIAS.start, ACCEL_BIAS.stop)])
    rows += [[ATTITUDE.start + axis, *range(GYRO_BIAS.start, GYRO_BIAS.stop)] for axis in range(3)]
    return [row + row[:1] * (_TERMS - len(row)) for row in rows]


_MOVERS: Final = np.array(_movers()).T.copy()
"""The n-th error that moves each of the MOVED ones."""
_UPPER: Final = np.array(
    [[max(i, j) * MOVED + min(i, j) for j in range(MOVED)] for i in range(MOVED)]
)
"""Where an entry of a symmetric block, or its mirror image, is in the transpose's lower half."""


class ArrayCovariance(Covariance):
    """Few calls, each for a whole array; memory for products is allocated once."""

    def __init__(self, sigmas: Sequence[float]) -> None:
        """Begin with errors of these standard deviations, independent of each other."""
        self._matrix: Array = np.diag(np.array(sigmas) ** 2)
        self._variances = self._matrix.reshape(-1)[:: SIZE + 1]  # Its diagonal
        self._added = np.zeros(SIZE)
        self._moved_rows = self._matrix[:MOVED, MOVED:]
        self._moved_columns = self._matrix[MOVED:, :MOVED]
        self._moved_block = self._matrix[:MOVED, :MOVED]
        self._gps_row, self._gps_column = (
            self._matrix[GPS_HEIGHT_BIAS],
            self._matrix[:, GPS_HEIGHT_BIAS],
        )
        self._rows = np.empty((MOVED, SIZE))
        self._beside = self._rows[:, MOVED:]
        self._first = np.empty((_TERMS, MOVED, SIZE))
        self._second = np.empty((_TERMS, MOVED, MOVED))
        self._block = np.empty((MOVED, MOVED))
        self._products = np.empty((SIZE, SIZE))
        self._views: list[_View] = []

    def matrix(self) -> Array:
        """A copy of the whole."""
        return self._matrix.copy()

    def replace(self, matrix: Array) -> None:
        """Take over a symmetric matrix."""
        self._matrix[:] = matrix
        self._views.clear()

    def variances(self) -> list[float]:
        """Diagonal."""
        variances: list[float] = self._variances.tolist()
        return variances

    def variance(self, index: int) -> float:
        """Variance of one error."""
        return self._variances.item(index)

    def set_noise(self, added: Sequence[float]) -> None:
        """Let every prediction from now on add these variances."""
        self._added[:] = added

    def predict(self, transition: Transition) -> None:
        """F P F' + Q."""
        self._views.clear()
        factors = np.array(_factors(transition))
        rows, block, first, second = self._rows, self._block, self._first, self._second
        self._matrix.take(_MOVERS, 0, first, "clip")
        first *= factors.repeat(SIZE).reshape(first.shape)  # A broadcast takes twice as long
        np.add.reduce(first, 0, None, out=rows)
        rows.T.take(_MOVERS, 0, second, "clip")
        second *= factors.repeat(MOVED).reshape(second.shape)
        np.add.reduce(second, 0, None, out=block)
        self._moved_rows[:] = self._beside
        self._moved_columns[:] = self._beside.T
        self._moved_block[:] = block.take(_UPPER)
        np.multiply(self._gps_row, transition.kept, self._gps_row)
        np.multiply(self._gps_column, transition.kept, self._gps_column)
        self._variances += self._added

    def expected(self, row: tuple[float, ...]) -> float:
        """Variance of what a measurement would be, its noise left out: H P H'."""
        return self._view(row).variance

    def _view(self, row: tuple[float, ...]) -> "_View":
        """What a measurement sees; a gate and a monitor ask for the same before it is fused."""
        for view in self._views:
            if view.row is row:
                return view
        across = np.array(row)
        # Spread over a matrix: numpy takes half as long again to broadcast a column
        np.multiply(self._matrix, across.repeat(SIZE).reshape(SIZE, SIZE), self._products)
        shared: Array = np.add.reduce(self._products, 0)
        view = _View(row, across, shared, _dot(across, shared))
        self._views.append(view)
        return view

    def fuse(self, measurements: Sequence[Measurement]) -> list[float]:
        """Take in one scalar after the other."""
        matrix = self._matrix
        error: Array | None = None  # Found by the measurements before
        for measurement in measurements:
            view = self._view(measurement.jacobian)
            shared, innovation = view.shared, measurement.innovation
            square = view.variance + measurement.variance
            if not square > 0.0:
                continue
            size = math.sqrt(square)
            shared /= size
            if error is None:
                error = shared * (innovation / size)
            else:
                error += shared * ((innovation - _dot(view.across, error)) / size)
            np.multiply(shared[:, None], shared, self._products)
            np.subtract(matrix, self._products, matrix)
            self._views.clear()
        if error is None:
            return [0.0] * SIZE
        errors: list[float] = error.tolist()
        return errors


class _View:
    """The covariance as a measurement sees it, until it changes."""

    __slots__ = ("across", "row", "shared", "variance")

    def __init__(
        self,
        row: tuple[float, ...],
        across: Array,  # The row
        shared: Array,  # Covariance of the measurement with each error: H P
        variance: float,  # H P H'
    ) -> None:
        self.row: Final = row
        self.across: Final = across
        self.shared: Final = shared
        self.variance: Final = variance


def _factors(transition: Transition) -> list[float]:
    """Entries of F in the order of `_MOVERS`."""
    elapsed, (ix, iy, iz) = transition.elapsed, transition.impulse_ned
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = transition.rotation
    xx, xy, xz = -elapsed * xx, -elapsed * xy, -elapsed * xz
    yx, yy, yz = -elapsed * yx, -elapsed * yy, -elapsed * yz
    zx, zy, zz = -elapsed * zx, -elapsed * zy, -elapsed * zz
    half = 0.5 * elapsed
    jx, jy, jz = half * ix, half * iy, half * iz
    return [
        *(1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
        *(elapsed, elapsed, elapsed, iz, -iz, iy, xx, yx, zx),
        *(jz, -jz, jy, -iy, ix, -ix, xy, yy, zy),
        *(-jy, jx, -jx, xx, yx, zx, xz, yz, zz),
        *(half * xx, half * yx, half * zx, xy, yy, zy, 0.0, 0.0, 0.0),
        *(half * xy, half * yy, half * zy, xz, yz, zz, 0.0, 0.0, 0.0),
        *(half * xz, half * yz, half * zz, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    ]


def _dot(first: Array, second: Array) -> float:
    """Scalar product, summed from the first to the last; `dot` and `sum` go other ways."""
    sums: Array = np.add.accumulate(first * second)
    return sums.item(-1)
