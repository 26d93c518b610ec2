"""Pseudo-measurements: standing still, and being nowhere in particular.

Zero velocity on the ground holds the estimate where GPS wanders, and lets the biases be seen.
Without any horizontal aid the tilt has no reference but the assumption that the vehicle does
not run away: a position held with a very large deviation (PX4 does the same, EKF2_NOAID_NOISE).
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from uav_firmware.modules.estimator.ekf import Measurement
from uav_firmware.modules.estimator.state import POSITION, SIZE, VELOCITY, NominalState
from uav_firmware.msg.vectors import Vector3

_VELOCITY_ROWS: Final = np.zeros((3, SIZE))
_VELOCITY_ROWS[:, VELOCITY] = np.eye(3)
_POSITION_ROWS: Final = np.zeros((3, SIZE))
_POSITION_ROWS[:, POSITION] = np.eye(3)


def zero_velocity(state: NominalState, sigma: float) -> Sequence[Measurement]:
    """Velocity is zero within sigma [m/s]."""
    return tuple(
        Measurement(-velocity, row, sigma * sigma)
        for velocity, row in zip(state.velocity_ned, _VELOCITY_ROWS, strict=True)
    )


def held_position(
    state: NominalState, held_ned: Vector3, sigma: float, axes: int
) -> Sequence[Measurement]:
    """The first `axes` of the position are those held, within sigma [m]."""
    return tuple(
        Measurement(held - position, row, sigma * sigma)
        for held, position, row in zip(
            held_ned[:axes], state.position_ned[:axes], _POSITION_ROWS[:axes], strict=True
        )
    )


class RestDetector:
    """Whether the vehicle moves, by the mean square of its rate and acceleration."""

    __slots__ = ("_acceleration", "_rate")

    _SMOOTHING: Final = 0.02  # [-] Share of one sample; 0.2 s at 250 Hz
    _LARGEST_RATE: Final = 0.1  # [rad/s] Root mean square
    _LARGEST_ACCELERATION: Final = 1.0  # [m/s^2]

    def __init__(self) -> None:
        self._rate = 0.0
        self._acceleration = 0.0

    def update(self, rate_frd: Vector3, acceleration: Vector3) -> None:
        """Take the rate [rad/s] and the acceleration without gravity [m/s^2] of a sample."""
        x, y, z = rate_frd
        self._rate += self._SMOOTHING * (x * x + y * y + z * z - self._rate)
        x, y, z = acceleration
        self._acceleration += self._SMOOTHING * (x * x + y * y + z * z - self._acceleration)

    @property
    def at_rest(self) -> bool:
        """True while both stay small; a steady hover is small as well."""
        return (
            self._rate < self._LARGEST_RATE**2
            and self._acceleration < self._LARGEST_ACCELERATION**2
        )
