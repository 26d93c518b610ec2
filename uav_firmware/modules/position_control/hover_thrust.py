"""Which thrust carries the weight: a Kalman filter with one state.

The model is the one of PX4's hover thrust estimator: thrust T lifts with
a = g (T / h - 1), where h is the hover thrust. With H = da/dh = -g T / h^2, the scalar
update is the textbook one (Kalman 1960). The estimate follows the battery and the
density of the air, slowly enough that the motors' lag does not matter.
"""

from typing import Final, NamedTuple

from uav_firmware.modules.position_control.control_math import GRAVITY

LOWEST: Final = 0.1  # [-] Of full thrust
HIGHEST: Final = 0.8


class HoverThrustNoise(NamedTuple):
    """What the filter believes of itself and of the accelerometer."""

    initial: float  # [-] One sigma of the parameter's value
    walk: float  # [1/sqrt(s)] Random walk of the hover thrust
    acceleration: float  # [m/s^2] One sigma of one acceleration sample
    gate: float  # [-] Largest innovation in sigmas


class HoverThrustEstimator:
    """The estimate and its variance."""

    __slots__ = ("_noise", "_variance", "hover")

    def __init__(self, hover: float, noise: HoverThrustNoise) -> None:
        self.hover = hover  # [-] Of full thrust
        self._noise = noise
        self._variance = noise.initial * noise.initial

    def reset(self, hover: float, noise: HoverThrustNoise) -> None:
        """Begin again from the parameter."""
        self.hover = hover
        self._noise = noise
        self._variance = noise.initial * noise.initial

    def update(self, thrust_up: float, acceleration_up: float, dt: float) -> float:
        """Learn from the vertical thrust [-] asked for and the acceleration [m/s^2] it gave."""
        noise = self._noise
        self._variance += noise.walk * noise.walk * dt
        slope = -GRAVITY * thrust_up / (self.hover * self.hover)
        innovation = acceleration_up - GRAVITY * (thrust_up / self.hover - 1.0)
        spread = slope * slope * self._variance + noise.acceleration * noise.acceleration
        if innovation * innovation <= noise.gate * noise.gate * spread:
            gain = self._variance * slope / spread
            hover = self.hover + gain * innovation
            inside = LOWEST <= hover <= HIGHEST
            self.hover = hover if inside else min(max(hover, LOWEST), HIGHEST)
            self._variance *= 1.0 - gain * slope
        return self.hover
