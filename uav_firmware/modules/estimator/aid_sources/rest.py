"""Aids that need no sensor: zero velocity at rest on the ground, a held position without any aid.

Zero velocity on the ground holds the estimate where GPS wanders, and lets the biases be seen.
Without any horizontal aid the tilt has no reference but the assumption that the vehicle does
not run away: a position held with a very large deviation (PX4 `zero_velocity_update.cpp` and
`fake_pos_control.cpp`, EKF2_NOAID_NOISE).
"""

from collections.abc import Sequence
from typing import Final

from uav_firmware.modules.estimator.ekf_core import EkfCore
from uav_firmware.modules.estimator.kalman_filter.covariance import Measurement, jacobian
from uav_firmware.modules.estimator.kalman_filter.gate import Aid
from uav_firmware.modules.estimator.kalman_filter.state import NominalState
from uav_firmware.msg.vectors import Vector3

_INTERVAL_US: Final = 100_000
_ZERO_VELOCITY_SIGMA_M_S: Final = 0.05
_ZERO_VELOCITY_GATE: Final = 5.0
_AXES: Final[tuple[Vector3, ...]] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_VELOCITY_ROWS: Final = tuple(jacobian(velocity=axis) for axis in _AXES)
_POSITION_ROWS: Final = tuple(jacobian(position=axis) for axis in _AXES)


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


class RestAiding:
    """Ten times a second at most."""

    def __init__(self) -> None:
        self.velocity = Aid(_ZERO_VELOCITY_GATE)
        self._held_ned: Vector3 | None = None

    def is_due(self, core: EkfCore) -> bool:
        """Whether `update` should be called in this step."""
        return core.time_us >= self.velocity.ready_us

    def update(self, core: EkfCore, *, horizontal_lost: bool, height_lost: bool) -> None:
        """Help where nothing else does."""
        now_us = core.time_us
        self.velocity.ready_us = now_us + _INTERVAL_US
        if core.standing:
            self.velocity.fuse(
                core.ekf, zero_velocity(core.state, _ZERO_VELOCITY_SIGMA_M_S), now_us
            )
        if not horizontal_lost:
            self._held_ned = None
            return
        if self._held_ned is None:
            self._held_ned = core.state.position_ned
        sigma, axes = core.params.no_aid_noise, 3 if height_lost else 2
        core.ekf.fuse(held_position(core.state, self._held_ned, sigma, axes))
