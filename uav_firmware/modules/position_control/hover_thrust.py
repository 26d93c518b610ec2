"""Which thrust carries the weight: a Kalman filter with one state.

The model is the one of PX4's hover thrust estimator: thrust T lifts with
a = g (T / h - 1), where h is the hover thrust. With H = da/dh = -g T / h^2, the scalar
update is the textbook one (Kalman 1960). The estimate follows the battery and the
density of the air, slowly enough that the motors' lag does not matter.

A single innovation beyond the gate is a shock and changes nothing. Innovations that stay beyond
it on one side mean that the estimate itself is wrong, by a parameter far off or a load that was
dropped: then the variance grows until they fit, as in PX4's filter.
"""

from typing import Final, NamedTuple

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2

LOWEST: Final = 0.1  # [-] Of full thrust
HIGHEST: Final = 0.8
_VALID_VARIANCE: Final = 0.001  # PX4's limit: 0.03 of full thrust, one sigma
_DOUBT_TIME_S: Final = 0.5  # In which innovations are averaged before the estimate is doubted
_DOUBTED: Final = 0.2  # [-] Averaged share of the gate, squared
_DOUBT_GROWTH: Final = 1.0e4  # [-] Of the random walk's variance


class HoverThrustNoise(NamedTuple):
    """What the filter believes of itself and of the accelerometer."""

    initial: float  # [-] One sigma of the parameter's value
    walk: float  # [1/sqrt(s)] Random walk of the hover thrust
    acceleration: float  # [m/s^2] One sigma of one acceleration sample
    gate: float  # [-] Largest innovation in sigmas


class HoverThrustEstimator:
    """The estimate and its variance."""

    __slots__ = ("_doubt", "_noise", "_variance", "hover", "learnt")

    def __init__(self, hover: float, noise: HoverThrustNoise) -> None:
        self.reset(hover, noise)

    def reset(self, hover: float, noise: HoverThrustNoise) -> None:
        """Begin again from the parameter."""
        self.hover = hover  # [-] Of full thrust
        self.learnt = False  # Whether measurements agree with it
        self._noise = noise
        self._variance = noise.initial * noise.initial
        self._doubt = 0.0  # Averaged innovations: signed, squared, in gates

    def update(self, thrust_up: float, acceleration_up: float, dt: float) -> float:
        """Update with the commanded vertical thrust [-] and its acceleration [m/s^2]."""
        noise = self._noise
        self._variance += noise.walk * noise.walk * dt
        slope = -STANDARD_GRAVITY_M_S2 * thrust_up / (self.hover * self.hover)
        innovation = acceleration_up - STANDARD_GRAVITY_M_S2 * (thrust_up / self.hover - 1.0)
        spread = slope * slope * self._variance + noise.acceleration * noise.acceleration
        ratio = innovation * innovation / (noise.gate * noise.gate * spread)
        signed = min(ratio, 1.0) if innovation > 0.0 else -min(ratio, 1.0)
        self._doubt += (signed - self._doubt) * dt / (dt + _DOUBT_TIME_S)
        if abs(self._doubt) > _DOUBTED:
            self._variance += _DOUBT_GROWTH * noise.walk * noise.walk * dt
        if ratio <= 1.0:
            gain = self._variance * slope / spread
            hover = self.hover + gain * innovation
            inside = LOWEST <= hover <= HIGHEST
            self.hover = hover if inside else min(max(hover, LOWEST), HIGHEST)
            self._variance *= 1.0 - gain * slope
            settled = abs(self._doubt) <= _DOUBTED
            self.learnt = settled and (self.learnt or self._variance < _VALID_VARIANCE)
        return self.hover
