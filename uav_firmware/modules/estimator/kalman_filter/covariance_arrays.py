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
    MOVERS,
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


def _block(moved: slice, movers: slice) -> list[int]:
    """Places of a block of F, row by row, in its transpose, which has MOVED columns."""
    return [
        mover * MOVED + row
        for row in range(moved.start, moved.stop)
        for mover in range(movers.start, movers.stop)
    ]


def _skew(block: list[int]) -> list[int]:
    """Without the diagonal."""
    return [place for at, place in enumerate(block) if at % 4 != 0]


_PLACES: Final = np.array(
    [
        *_block(POSITION, VELOCITY)[::4],  # Its diagonal
        *_skew(_block(VELOCITY, ATTITUDE)),
        *_skew(_block(POSITION, ATTITUDE)),
        *_block(VELOCITY, ACCEL_BIAS),
        *_block(POSITION, ACCEL_BIAS),
        *_block(ATTITUDE, GYRO_BIAS),
    ]
)
"""Where F differs from the identity."""
_BELOW: Final = np.tril(np.ones((MOVED, MOVED), dtype=np.bool_), -1)


class ArrayCovariance(Covariance):
    """Few calls, each for a whole array; memory for products is allocated once."""

    def __init__(self, sigmas: Sequence[float]) -> None:
        """Begin with errors of these standard deviations, independent of each other."""
        self._matrix: Array = np.diag(np.array(sigmas) ** 2)
        self._variances = self._matrix.reshape(-1)[:: SIZE + 1]  # Its diagonal
        self._added = np.zeros(SIZE)
        self._transition = np.eye(MOVERS, MOVED)
        self._by_movers = self._transition[:, :, None]
        self._by_rows = self._transition[:, None, :]
        self._moving_rows = self._matrix[:MOVERS, None, :]
        self._rows = np.empty((MOVED, SIZE))
        self._row_movers = self._rows[:, :MOVERS].T[:, :, None]
        self._block = np.empty((MOVED, MOVED))
        self._first, self._second = (
            np.empty((MOVERS, MOVED, SIZE)),
            np.empty((MOVERS, MOVED, MOVED)),
        )
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
        self._transition.put(_PLACES, _couplings(transition))
        matrix, rows, block = self._matrix, self._rows, self._block
        self._views.clear()
        np.multiply(self._by_movers, self._moving_rows, self._first)
        np.add.reduce(self._first, 0, None, out=rows)
        np.multiply(self._row_movers, self._by_rows, self._second)
        np.add.reduce(self._second, 0, None, out=block)
        np.copyto(block, block.T.copy(), where=_BELOW)
        matrix[:MOVED] = rows
        matrix[:, :MOVED] = rows.T
        matrix[:MOVED, :MOVED] = block
        matrix[GPS_HEIGHT_BIAS] *= transition.kept
        matrix[:, GPS_HEIGHT_BIAS] *= transition.kept
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
        np.multiply(self._matrix, across[:, None], self._products)
        shared: Array = np.add.reduce(self._products, 0)
        view = _View(row, across, shared, _dot(across, shared))
        self._views.append(view)
        return view

    def fuse(self, measurements: Sequence[Measurement]) -> list[float]:
        """Take in one scalar after the other."""
        matrix, error = self._matrix, np.zeros(SIZE)
        for measurement in measurements:
            view = self._view(measurement.jacobian)
            across, shared = view.across, view.shared
            square = view.variance + measurement.variance
            if not square > 0.0:
                continue
            size = math.sqrt(square)
            shared /= size
            error += shared * ((measurement.innovation - _dot(across, error)) / size)
            np.multiply(shared[:, None], shared, self._products)
            np.subtract(matrix, self._products, matrix)
            self._views.clear()
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


def _couplings(transition: Transition) -> list[float]:
    """Entries of F in the order of `_PLACES`."""
    elapsed, (ix, iy, iz) = transition.elapsed, transition.impulse_ned
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = transition.rotation
    xx, xy, xz = -elapsed * xx, -elapsed * xy, -elapsed * xz
    yx, yy, yz = -elapsed * yx, -elapsed * yy, -elapsed * yz
    zx, zy, zz = -elapsed * zx, -elapsed * zy, -elapsed * zz
    half = 0.5 * elapsed
    jx, jy, jz = half * ix, half * iy, half * iz
    return [
        *(elapsed, elapsed, elapsed),
        *(iz, -iy, -iz, ix, iy, -ix),
        *(jz, -jy, -jz, jx, jy, -jx),
        *(xx, xy, xz, yx, yy, yz, zx, zy, zz),
        *(half * xx, half * xy, half * xz),
        *(half * yx, half * yy, half * yz),
        *(half * zx, half * zy, half * zz),
        *(xx, xy, xz, yx, yy, yz, zx, zy, zz),
    ]


def _dot(first: Array, second: Array) -> float:
    """Scalar product, summed from the first to the last; `dot` and `sum` go other ways."""
    sums: Array = np.add.accumulate(first * second)
    return sums.item(-1)
