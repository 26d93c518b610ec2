"""Estimates position and velocity of a reported target: pure.

A Kalman filter with constant velocity on each axis, driven by white acceleration (Bar-Shalom, Li,
Kirubarajan 2001, "Estimation with Applications to Tracking and Navigation", section 6.2.2). Time
is an argument. Frames: NED, SI.
"""

import math
from typing import Final

from uav_firmware.msg.vectors import Vector3

STALE_S: Final = 3.0
"""[s] Without an accepted report for longer the target is lost."""
_SIGMAS: Final = 3.0  # Gate of a reported position, besides the motion of the target
_FIRST_SPEED_SIGMA: Final = 3.0  # [m/s] Of a new target
_SPEED_SIGMA: Final = 0.3  # [m/s] Of a reported velocity
_CONFIRMED: Final = 2  # Consistent reports until a target is valid


class _Axis:
    """Position and velocity along one axis, and their covariance."""

    __slots__ = ("position", "pp", "pv", "velocity", "vv")

    def __init__(self, position: float, sigma: float) -> None:
        self.position, self.velocity = position, 0.0
        self.pp, self.pv, self.vv = sigma * sigma, 0.0, _FIRST_SPEED_SIGMA**2

    def predict(self, dt: float, acceleration_sigma: float) -> None:
        """Predict over `dt` [s]."""
        q = acceleration_sigma * acceleration_sigma
        self.position += self.velocity * dt
        self.pp += 2.0 * dt * self.pv + dt * dt * self.vv + q * dt**3 / 3.0
        self.pv += dt * self.vv + q * dt * dt / 2.0
        self.vv += q * dt

    def fuse_position(self, position: float, sigma: float) -> None:
        """Fuse a measured position."""
        total = self.pp + sigma * sigma
        gain_p, gain_v, error = self.pp / total, self.pv / total, position - self.position
        self.position += gain_p * error
        self.velocity += gain_v * error
        self.vv -= gain_v * self.pv
        self.pv *= 1.0 - gain_p
        self.pp *= 1.0 - gain_p

    def fuse_velocity(self, velocity: float, sigma: float) -> None:
        """Fuse a measured velocity."""
        total = self.vv + sigma * sigma
        gain_p, gain_v, error = self.pv / total, self.vv / total, velocity - self.velocity
        self.position += gain_p * error
        self.velocity += gain_v * error
        self.pp -= gain_p * self.pv
        self.pv *= 1.0 - gain_v
        self.vv *= 1.0 - gain_v


class TargetEstimator:
    """Estimates one target; drops reports that jump."""

    def __init__(self) -> None:
        self._axes: tuple[_Axis, _Axis, _Axis] | None = None
        self._time_us = 0
        self._accepted = 0

    def reset(self) -> None:
        """Drop the target."""
        self._axes, self._accepted = None, 0

    def known(self, now_us: int) -> bool:
        """Whether two reports agree and the newest is not older than `STALE_S`."""
        age_s = (now_us - self._time_us) * 1e-6
        return self._axes is not None and self._accepted >= _CONFIRMED and age_s <= STALE_S

    def report(
        self,
        now_us: int,
        position: Vector3,
        velocity: Vector3 | None,
        *,
        sigma: float,
        acceleration_sigma: float,
        speed_max: float,
    ) -> bool:
        """Fuse a report; False when it is outside the gate.

        Args:
            now_us: time of the report [us].
            position: [m].
            velocity: [m/s], None where it is not reported.
            sigma: of the position [m].
            acceleration_sigma: deviation of the acceleration of the target [m/s^2].
            speed_max: largest speed of a target [m/s].
        """
        axes, dt = self._axes, (now_us - self._time_us) * 1e-6
        if axes is None or dt > STALE_S:
            self._axes = (
                _Axis(position[0], sigma),
                _Axis(position[1], sigma),
                _Axis(position[2], sigma),
            )
            axes, dt, self._accepted = self._axes, 0.0, 0
        elif self._jumps(position, sigma, speed_max * dt):
            return False
        self._time_us = now_us
        self._accepted += 1
        for index, axis in enumerate(axes):
            axis.predict(dt, acceleration_sigma)
            if self._accepted > 1:
                axis.fuse_position(position[index], sigma)
            if velocity is not None:
                axis.fuse_velocity(velocity[index], _SPEED_SIGMA)
        return True

    def at(self, now_us: int) -> tuple[Vector3, Vector3]:
        """Position [m] and velocity [m/s] extrapolated to a time.

        Raises:
            ValueError: without a target.
        """
        if self._axes is None:
            raise ValueError("no target has been reported")
        dt = (now_us - self._time_us) * 1e-6
        north, east, down = self._axes
        return (
            (
                north.position + north.velocity * dt,
                east.position + east.velocity * dt,
                down.position + down.velocity * dt,
            ),
            (north.velocity, east.velocity, down.velocity),
        )

    def _jumps(self, position: Vector3, sigma: float, travel: float) -> bool:
        if self._axes is None:
            return False
        north, east, _ = self._axes
        off = math.hypot(position[0] - north.position, position[1] - east.position)
        spread = math.sqrt(sigma * sigma + max(north.pp, east.pp))
        return off > travel + _SIGMAS * spread
