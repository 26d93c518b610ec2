"""Aids that need no sensor: zero velocity while standing, a held position when all is lost."""

from typing import Final

from uav_firmware.modules.estimator.core import Core
from uav_firmware.modules.estimator.fuse_rest import held_position, zero_velocity
from uav_firmware.modules.estimator.gate import Aid
from uav_firmware.msg.vectors import Vector3

_INTERVAL_US: Final = 100_000
_ZERO_VELOCITY_SIGMA_M_S: Final = 0.05
_ZERO_VELOCITY_GATE: Final = 5.0


class RestAiding:
    """Ten times a second at most."""

    def __init__(self) -> None:
        self.velocity = Aid(_ZERO_VELOCITY_GATE)
        self._held_ned: Vector3 | None = None

    def is_due(self, core: Core) -> bool:
        """Whether `take` should be called in this step."""
        return core.time_us >= self.velocity.ready_us

    def take(self, core: Core, *, horizontal_lost: bool, height_lost: bool) -> None:
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
