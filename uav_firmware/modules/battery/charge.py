"""Charge of a pack from its terminal voltage and current: PX4's battery library (`battery.cpp`).

Per cell, with current I and internal resistance R:

    v = V / cells + I R                            load compensated, low-passed over 1 s
    by voltage  = (v - empty) / (charged - empty)  clamped to 0..1
    by current  = 1 - integral of I / capacity

    w = 0.3 (1 - by voltage) dt
    remaining <- min(remaining - I dt / capacity + w (by voltage - remaining), by current)

The emptier the pack, the more the voltage counts: integrated current contains neither with what
charge the pack was put in nor what it has lost by age. Until two seconds after a pack is there,
and with an unknown capacity, voltage alone counts.
"""

import math
from typing import Final, NamedTuple

_RECOGNISED_V: Final = 2.1  # Less is no lithium pack
_SETTLING_US: Final = 2_000_000
_VOLTAGE_TIME_S: Final = 1.0
_VOLTAGE_PULL_PER_S: Final = 0.3  # PX4's 0.03 at each of ten samples a second
_LONGEST_STEP_S: Final = 2.0
_SECONDS_PER_HOUR: Final = 3600.0


class Pack(NamedTuple):
    """What is known of a pack."""

    cells: int  # [-] In series, at least 1
    cell_empty_v: float  # [V] Load compensated
    cell_charged_v: float  # [V] Above `cell_empty_v`
    cell_resistance_ohm: float  # [Ohm]
    capacity_ah: float  # [Ah] Not above 0: unknown


class ChargeEstimator:
    """Estimate of one pack; `update` takes its samples in the order of their times."""

    def __init__(self, pack: Pack) -> None:
        self.pack = pack
        """May be replaced at any time."""
        self.consumed_ah = 0.0
        """Integrated current [Ah]."""
        self.remaining = 0.0
        """Estimated charge, 0 empty to 1 full; 0 before the first sample."""
        self._cell_v: float | None = None  # Low-passed; None while no pack is there
        self._connected_us = 0
        self._last_us: int | None = None

    def update(self, time_us: int, voltage_v: float, current_a: float) -> None:
        """Add a sample [us, V, A]; one with an invalid voltage is ignored.

        An invalid current counts as 0: the voltage is then used without compensation.
        """
        if not math.isfinite(voltage_v):
            return
        current_a = current_a if math.isfinite(current_a) else 0.0
        elapsed_s = 0.0 if self._last_us is None else max(0.0, (time_us - self._last_us) * 1e-6)
        self._last_us = time_us
        drawn_ah = current_a * elapsed_s / _SECONDS_PER_HOUR
        self.consumed_ah += drawn_ah
        if voltage_v < _RECOGNISED_V:
            self._cell_v, self.remaining = None, 0.0
            return
        by_voltage = self._by_voltage(time_us, voltage_v, current_a, elapsed_s)
        capacity_ah = self.pack.capacity_ah
        if capacity_ah <= 0.0 or time_us - self._connected_us <= _SETTLING_US:
            self.remaining = by_voltage
            return
        pull = min(1.0, _VOLTAGE_PULL_PER_S * elapsed_s) * (1.0 - by_voltage)
        blended = self.remaining + pull * (by_voltage - self.remaining) - drawn_ah / capacity_ah
        by_current = 1.0 - self.consumed_ah / capacity_ah
        self.remaining = max(0.0, min(blended, by_current, 1.0))

    def _by_voltage(
        self, time_us: int, voltage_v: float, current_a: float, elapsed_s: float
    ) -> float:
        """Charge, 0 to 1, of the load compensated voltage of a cell."""
        pack = self.pack
        cell_v = voltage_v / pack.cells + current_a * pack.cell_resistance_ohm
        if self._cell_v is None:
            self._cell_v, self._connected_us = cell_v, time_us
        else:
            step_s = min(elapsed_s, _LONGEST_STEP_S)
            self._cell_v += step_s / (step_s + _VOLTAGE_TIME_S) * (cell_v - self._cell_v)
        share = (self._cell_v - pack.cell_empty_v) / (pack.cell_charged_v - pack.cell_empty_v)
        return min(max(share, 0.0), 1.0)
