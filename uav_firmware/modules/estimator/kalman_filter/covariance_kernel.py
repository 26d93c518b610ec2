"""The covariance in plain loops, for the compiled flight stack: see `covariance`.

`vec` is mypyc's array of unboxed numbers. F is mostly zero and the matrix symmetric: a prediction
takes a thousand products instead of the sixteen thousand of two full ones. Terms are added in the
order in which `covariance_arrays` adds them; the zeros that it adds besides change nothing.
"""

import math
from collections.abc import Sequence

import numpy as np
from librt.vecs import vec

from uav_firmware.modules.estimator.kalman_filter.covariance import (
    MOVED,
    Array,
    Covariance,
    Measurement,
    Transition,
)
from uav_firmware.modules.estimator.kalman_filter.state import GPS_HEIGHT_BIAS, SIZE
from uav_firmware.msg.vectors import Vector3


class KernelCovariance(Covariance):
    """All SIZE times SIZE entries, row by row."""

    def __init__(self, sigmas: Sequence[float]) -> None:
        """Begin with errors of these standard deviations, independent of each other."""
        self._entries = _zeros(SIZE * SIZE)
        self._added = _zeros(SIZE)
        self._rows = _zeros(MOVED * SIZE)  # F P, as far as it differs from P
        self._moved = _zeros(MOVED)  # One of those rows, times F'
        self._shared = _zeros(SIZE)  # Covariance of a measurement with each error: H P
        self._error = _zeros(SIZE)
        for index, sigma in enumerate(sigmas):
            self._entries[index * (SIZE + 1)] = sigma * sigma

    def matrix(self) -> Array:
        """A copy of the whole."""
        return np.array(list(self._entries)).reshape(SIZE, SIZE)

    def replace(self, matrix: Array) -> None:
        """Take over a symmetric matrix."""
        numbers: list[float] = matrix.reshape(-1).tolist()
        entries = self._entries
        for place, number in enumerate(numbers):
            entries[place] = number

    def variances(self) -> list[float]:
        """Diagonal."""
        entries = self._entries
        return [entries[index * (SIZE + 1)] for index in range(SIZE)]

    def variance(self, index: int) -> float:
        """Variance of one error."""
        return self._entries[index * (SIZE + 1)]

    def set_noise(self, added: Sequence[float]) -> None:
        """Let every prediction from now on add these variances."""
        for index, variance in enumerate(added):
            self._added[index] = variance

    def predict(self, transition: Transition) -> None:
        """F P F' + Q."""
        flow = _Flow(transition)
        self._move_rows(flow)
        self._move_columns(flow)
        entries, kept, added = self._entries, transition.kept, self._added
        for index in range(SIZE):
            entries[GPS_HEIGHT_BIAS * SIZE + index] *= kept
        for index in range(SIZE):
            entries[index * SIZE + GPS_HEIGHT_BIAS] *= kept
        for index in range(SIZE):
            entries[index * (SIZE + 1)] += added[index]

    def _move_rows(self, flow: "_Flow") -> None:
        """F P: what becomes of each column."""
        p, rows = self._entries, self._rows
        for j in range(SIZE):
            position, velocity, tilt = flow.move(
                (p[j], p[SIZE + j], p[2 * SIZE + j]),
                (p[3 * SIZE + j], p[4 * SIZE + j], p[5 * SIZE + j]),
                (p[6 * SIZE + j], p[7 * SIZE + j], p[8 * SIZE + j]),
                (p[9 * SIZE + j], p[10 * SIZE + j], p[11 * SIZE + j]),
                (p[12 * SIZE + j], p[13 * SIZE + j], p[14 * SIZE + j]),
            )
            rows[j], rows[SIZE + j], rows[2 * SIZE + j] = position
            rows[3 * SIZE + j], rows[4 * SIZE + j], rows[5 * SIZE + j] = velocity
            rows[6 * SIZE + j], rows[7 * SIZE + j], rows[8 * SIZE + j] = tilt

    def _move_columns(self, flow: "_Flow") -> None:
        """(F P) F': what becomes of each row, from the diagonal on; the rest is its mirror."""
        p, rows, moved = self._entries, self._rows, self._moved
        for i in range(MOVED):
            r = i * SIZE
            position, velocity, tilt = flow.move(
                (rows[r], rows[r + 1], rows[r + 2]),
                (rows[r + 3], rows[r + 4], rows[r + 5]),
                (rows[r + 6], rows[r + 7], rows[r + 8]),
                (rows[r + 9], rows[r + 10], rows[r + 11]),
                (rows[r + 12], rows[r + 13], rows[r + 14]),
            )
            moved[0], moved[1], moved[2] = position
            moved[3], moved[4], moved[5] = velocity
            moved[6], moved[7], moved[8] = tilt
            for j in range(i, MOVED):
                p[r + j] = p[j * SIZE + i] = moved[j]
            for j in range(MOVED, SIZE):
                p[r + j] = p[j * SIZE + i] = rows[r + j]

    def expected(self, row: tuple[float, ...]) -> float:
        """Variance of what a measurement would be, its noise left out: H P H'."""
        self._share(row)
        return _dot(row, self._shared)

    def _share(self, row: tuple[float, ...]) -> None:
        """H P into `_shared`."""
        p, shared = self._entries, self._shared
        for j in range(SIZE):
            shared[j] = 0.0
        for i in range(SIZE):
            weight = row[i]
            if weight != 0.0:  # A measurement is of few errors
                for j in range(SIZE):
                    shared[j] += p[i * SIZE + j] * weight

    def fuse(self, measurements: Sequence[Measurement]) -> list[float]:
        """Take in one scalar after the other."""
        p, shared, error = self._entries, self._shared, self._error
        for j in range(SIZE):
            error[j] = 0.0
        for measurement in measurements:
            row = measurement.jacobian
            self._share(row)
            square = _dot(row, shared) + measurement.variance
            if not square > 0.0:
                continue
            size = math.sqrt(square)
            step = (measurement.innovation - _dot(row, error)) / size
            for j in range(SIZE):
                scaled = shared[j] / size
                shared[j] = scaled
                error[j] += scaled * step
            for i in range(SIZE):
                scaled = shared[i]
                for j in range(SIZE):
                    p[i * SIZE + j] -= scaled * shared[j]
        return [error[j] for j in range(SIZE)]


class _Flow:
    """F, as what it makes of an error: a tilt turns the impulse, biases enter in body axes."""

    def __init__(self, transition: Transition) -> None:
        self.elapsed = elapsed = transition.elapsed
        ix, iy, iz = transition.impulse_ned
        to_north, to_east, to_down = transition.rotation
        xx, xy, xz = to_north
        yx, yy, yz = to_east
        zx, zy, zz = to_down
        half = 0.5 * elapsed
        self.ix, self.iy, self.iz = ix, iy, iz
        self.jx, self.jy, self.jz = half * ix, half * iy, half * iz
        self.xx, self.xy, self.xz = -elapsed * xx, -elapsed * xy, -elapsed * xz
        self.yx, self.yy, self.yz = -elapsed * yx, -elapsed * yy, -elapsed * yz
        self.zx, self.zy, self.zz = -elapsed * zx, -elapsed * zy, -elapsed * zz
        self.hxx, self.hxy, self.hxz = half * self.xx, half * self.xy, half * self.xz
        self.hyx, self.hyy, self.hyz = half * self.yx, half * self.yy, half * self.yz
        self.hzx, self.hzy, self.hzz = half * self.zx, half * self.zy, half * self.zz

    def move(
        self,
        position: Vector3,
        velocity: Vector3,
        tilt: Vector3,
        accel_bias: Vector3,
        gyro_bias: Vector3,
    ) -> tuple[Vector3, Vector3, Vector3]:
        """Position, velocity and tilt after the interval."""
        px, py, pz = position
        vx, vy, vz = velocity
        rx, ry, rz = tilt
        ax, ay, az = accel_bias
        gx, gy, gz = gyro_bias
        e, ix, iy, iz = self.elapsed, self.ix, self.iy, self.iz
        jx, jy, jz = self.jx, self.jy, self.jz
        return (
            (
                px + e * vx + jz * ry - jy * rz + self.hxx * ax + self.hxy * ay + self.hxz * az,
                py + e * vy - jz * rx + jx * rz + self.hyx * ax + self.hyy * ay + self.hyz * az,
                pz + e * vz + jy * rx - jx * ry + self.hzx * ax + self.hzy * ay + self.hzz * az,
            ),
            (
                vx + iz * ry - iy * rz + self.xx * ax + self.xy * ay + self.xz * az,
                vy - iz * rx + ix * rz + self.yx * ax + self.yy * ay + self.yz * az,
                vz + iy * rx - ix * ry + self.zx * ax + self.zy * ay + self.zz * az,
            ),
            (
                rx + self.xx * gx + self.xy * gy + self.xz * gz,
                ry + self.yx * gx + self.yy * gy + self.yz * gz,
                rz + self.zx * gx + self.zy * gy + self.zz * gz,
            ),
        )


def _zeros(number: int) -> vec[float]:
    return vec[float]([0.0] * number)


def _dot(row: tuple[float, ...], vector: vec[float]) -> float:
    total = row[0] * vector[0]
    for index in range(1, SIZE):
        total += row[index] * vector[index]
    return total
