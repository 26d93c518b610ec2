"""The rate law: PID on body rates, one axis at a time.

torque = P (setpoint - rate) + I integral(setpoint - rate) - D d(rate)/dt

The derivative acts on the measurement, so that a step of the setpoint does not kick, and
passes a first-order low pass. The integrator stops in the direction in which the allocator
could not follow (conditional integration), and slows down during large errors, where what it
would collect is the flip and not a disturbance.
"""

import math
from typing import NamedTuple

from uav_firmware.msg.vectors import Vector3

_LARGE_ERROR = math.radians(400.0)  # [rad/s] Error at which the integrator stands still


class AxisGains(NamedTuple):
    """Gains of one axis; torque is normalised, -1 to 1."""

    p: float  # [1/(rad/s)]
    i: float  # [1/rad]
    d: float  # [1/(rad/s^2)]
    integral_limit: float  # [-] Largest torque held by the integrator


class RateAxis:
    """The loop about one body axis."""

    __slots__ = ("_derivative", "_has_last", "_last_rate", "gains", "integral")

    def __init__(self, gains: AxisGains) -> None:
        self.gains = gains
        self.integral = 0.0  # [-] Torque that the integrator holds
        self._has_last = False
        self._last_rate = 0.0  # [rad/s] Of the sample before, if there is one
        self._derivative = 0.0  # [rad/s^2] Low-passed

    def reset(self) -> None:
        """Forget the past: before take-off, and when the motors stand."""
        self.integral = 0.0
        self._has_last = False
        self._derivative = 0.0

    def update(
        self, setpoint: float, rate: float, unallocated: float, dt: float, smoothing: float
    ) -> float:
        """Torque [-1..1] for a wanted and a measured rate [rad/s].

        `unallocated` is the torque that the allocator left out last time, wanted minus
        produced; `smoothing` is the share of a new derivative sample in the low pass, 0 to 1.
        """
        p, i, d, limit = self.gains  # Cheaper than field by field
        error = setpoint - rate
        if self._has_last:
            sample = (rate - self._last_rate) / dt
            self._derivative += smoothing * (sample - self._derivative)
        self._has_last, self._last_rate = True, rate
        torque = p * error + self.integral - d * self._derivative
        if unallocated * error <= 0.0:
            ratio = error / _LARGE_ERROR
            if -1.0 < ratio < 1.0:
                integral = self.integral + i * error * (1.0 - ratio * ratio) * dt
                inside = -limit <= integral <= limit
                self.integral = integral if inside else min(max(integral, -limit), limit)
        # The usual case first: min and max cost more than the rest of the loop.
        return torque if -1.0 <= torque <= 1.0 else min(max(torque, -1.0), 1.0)


class RateController:
    """The three axes together."""

    __slots__ = ("_axes", "_derivative_time")

    def __init__(self, gains: tuple[AxisGains, AxisGains, AxisGains], cutoff_hz: float) -> None:
        self._axes = (RateAxis(gains[0]), RateAxis(gains[1]), RateAxis(gains[2]))
        self._derivative_time = 1.0 / (2.0 * math.pi * cutoff_hz)  # [s]

    def tune(self, gains: tuple[AxisGains, AxisGains, AxisGains], cutoff_hz: float) -> None:
        """Change the gains in flight; integrators keep their torque."""
        for axis, axis_gains in zip(self._axes, gains, strict=True):
            axis.gains = axis_gains
        self._derivative_time = 1.0 / (2.0 * math.pi * cutoff_hz)

    def reset(self) -> None:
        """Forget the past of all axes."""
        for axis in self._axes:
            axis.reset()

    def update(
        self, setpoint_frd: Vector3, rate_frd: Vector3, unallocated_frd: Vector3, dt: float
    ) -> Vector3:
        """Normalised torque about each body axis for wanted and measured rates [rad/s]."""
        smoothing = dt / (dt + self._derivative_time)
        roll, pitch, yaw = self._axes
        return (
            roll.update(setpoint_frd[0], rate_frd[0], unallocated_frd[0], dt, smoothing),
            pitch.update(setpoint_frd[1], rate_frd[1], unallocated_frd[1], dt, smoothing),
            yaw.update(setpoint_frd[2], rate_frd[2], unallocated_frd[2], dt, smoothing),
        )
