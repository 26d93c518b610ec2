"""Heading setpoint that takes the shorter turn within a rate and an acceleration."""

import math

from uav_firmware.lib.rotation import wrap_pi

_SETTLED = 1e-3  # [rad] Within this the turn is complete


class YawSlew:
    """A heading [rad] and its rate [rad/s] that turns to a target."""

    def __init__(self) -> None:
        self.yaw = 0.0
        self.rate = 0.0
        self.settled = True

    def reset(self, yaw: float) -> None:
        """Begin again at a heading, at rest."""
        self.yaw, self.rate, self.settled = wrap_pi(yaw), 0.0, True

    def advance(
        self,
        target: float,
        dt: float,
        rate_max: float,
        acceleration_max: float,
        target_rate: float = 0.0,
    ) -> None:
        """Turn towards `target` [rad] for `dt` [s], braking in time to stay on it.

        A target that itself turns at `target_rate` [rad/s] is followed without lag.
        """
        error = wrap_pi(target - self.yaw)
        self._turn(error, dt, rate_max, acceleration_max, target_rate)
        if self.settled:
            self.yaw = wrap_pi(target)

    def turn_by(self, angle: float, dt: float, rate_max: float, acceleration_max: float) -> float:
        """Turn through `angle` [rad], in the direction of its sign; returns the rest of it."""
        before = self.yaw
        self._turn(angle, dt, rate_max, acceleration_max, 0.0)
        if self.settled:
            self.yaw = wrap_pi(before + angle)
            return 0.0
        return angle - wrap_pi(self.yaw - before)

    def _turn(
        self, error: float, dt: float, rate_max: float, acceleration_max: float, target_rate: float
    ) -> None:
        step = acceleration_max * dt
        relative = self.rate - target_rate
        self.settled = abs(error) < _SETTLED and abs(relative) <= step
        if self.settled:
            self.rate = target_rate
            return
        # Rate from which a stop at the target is just possible, one step ahead.
        braking = math.sqrt(2.0 * acceleration_max * abs(error) + 0.25 * step * step) - 0.5 * step
        rate = target_rate + math.copysign(min(max(braking, 0.0), abs(error) / dt), error)
        rate = max(-rate_max, min(rate_max, rate))
        self.rate += max(-step, min(step, rate - self.rate))
        self.yaw = wrap_pi(self.yaw + self.rate * dt)
