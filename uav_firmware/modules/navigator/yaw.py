"""Heading set-point that turns the shorter way within a rate and an acceleration."""

import math

from uav_firmware.lib.rotation import wrap_pi

_SETTLED = 1e-3  # [rad] closer than this, the turn is over


class YawSlew:
    """A heading [rad] and its rate [rad/s] on the way to a target."""

    def __init__(self) -> None:
        self.yaw = 0.0
        self.rate = 0.0
        self.settled = True

    def reset(self, yaw: float) -> None:
        """Begin again at a heading, at rest."""
        self.yaw, self.rate, self.settled = wrap_pi(yaw), 0.0, True

    def advance(self, target: float, dt: float, rate_max: float, acceleration_max: float) -> None:
        """Turn towards `target` [rad] for `dt` [s], braking in time to stop at it."""
        error = wrap_pi(target - self.yaw)
        step = acceleration_max * dt
        self.settled = abs(error) < _SETTLED and abs(self.rate) <= step
        if self.settled:
            self.yaw, self.rate = wrap_pi(target), 0.0
            return
        # Rate from which a stop at the target is just possible, one step ahead.
        braking = math.sqrt(2.0 * acceleration_max * abs(error) + 0.25 * step * step) - 0.5 * step
        wanted = math.copysign(min(rate_max, max(braking, 0.0), abs(error) / dt), error)
        self.rate += max(-step, min(step, wanted - self.rate))
        self.yaw = wrap_pi(self.yaw + self.rate * dt)
