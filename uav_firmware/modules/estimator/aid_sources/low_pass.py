"""First-order low-pass filter; the time step is an argument, so that no clock is needed.

y follows x with dy/dt = (x - y) / tau, tau = 1 / (2 pi f). The step is solved exactly for an
input held constant over it, so the filter is stable for any dt and never overshoots.
"""

import math


def _share(cutoff_hz: float, dt: float) -> float:
    """Share of the difference to the input that is covered in dt [s]; 1 without a cut-off."""
    if cutoff_hz <= 0.0:
        return 1.0
    return -math.expm1(-math.tau * cutoff_hz * dt)


class LowPass:
    """Low pass for a number. Starts at its first input; a cut-off of 0 passes all."""

    __slots__ = ("_cutoff_hz", "_dt", "_gain", "value")

    def __init__(self, cutoff_hz: float, value: float | None = None) -> None:
        self._cutoff_hz = cutoff_hz
        self._dt = math.nan
        self._gain = 1.0
        self.value = value

    def update(self, sample: float, dt: float) -> float:
        """Filter a sample that holds since dt [s]; return the output."""
        if dt != self._dt:
            self._dt, self._gain = dt, _share(self._cutoff_hz, dt)
        held = sample if self.value is None else self.value
        self.value = held + self._gain * (sample - held)
        return self.value
