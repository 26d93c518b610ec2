"""A four-cell lithium polymer pack and its monitor.

Terminal voltage V = E(charge) - I R; the load draws power P = V I, hence
I = (E - sqrt(E^2 - 4 R P)) / (2 R). A pack that cannot give the power any more gives its most,
E^2 / 4R. Charge is counted in ampere-hours. An empty pack cuts off.

The open-circuit curve is that of a usual lithium polymer cell: 4.2 V full, 3.7 V about a
third, 3.3 V empty. R, 25 mOhm, is four cells of 4 mOhm with leads and plugs. Avionics take
6 W besides the motors.
"""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Final

import numpy as np

from sim.physics.noise import standard_normals
from sim.sensors.readings import BatteryReading

RATE_HZ: Final = 10
DRAW_RATE_HZ: Final = 50
"""How often the load is taken from the pack: fast against the motors' 56 ms."""

CELLS: Final = 4
INTERNAL_RESISTANCE_OHM: Final = 0.025
AVIONICS_POWER_W: Final = 6.0
VOLTAGE_SIGMA_V: Final = 0.02
CURRENT_SIGMA_A: Final = 0.1
_SECONDS_PER_HOUR: Final = 3600.0

CELL_CURVE: Final[tuple[tuple[float, float], ...]] = (
    (0.00, 3.30),
    (0.05, 3.50),
    (0.10, 3.61),
    (0.20, 3.69),
    (0.30, 3.73),
    (0.40, 3.77),
    (0.50, 3.81),
    (0.60, 3.86),
    (0.70, 3.93),
    (0.80, 4.01),
    (0.90, 4.10),
    (1.00, 4.20),
)
"""Charge [0 to 1] and open-circuit voltage [V] of one cell."""


def open_circuit_voltage_v(charge: float) -> float:
    """Voltage [V] of the unloaded pack: the curve, straight between its points."""
    if charge <= 0.0:
        return CELLS * CELL_CURVE[0][1]
    for (charge_0, volts_0), (charge_1, volts_1) in pairwise(CELL_CURVE):
        if charge <= charge_1:
            share = (charge - charge_0) / (charge_1 - charge_0)
            return CELLS * (volts_0 + share * (volts_1 - volts_0))
    return CELLS * CELL_CURVE[-1][1]


def current_for_power_a(power_w: float, open_circuit_v: float) -> float:
    """Current [A] at which the pack gives `power_w`, or its most if that is too much."""
    discriminant = open_circuit_v**2 - 4.0 * INTERNAL_RESISTANCE_OHM * power_w
    return (open_circuit_v - math.sqrt(max(discriminant, 0.0))) / (2.0 * INTERNAL_RESISTANCE_OHM)


class Battery:
    """Charge, load and the monitor's noise; `factor` scales the noise alone."""

    def __init__(
        self,
        generator: np.random.Generator,
        *,
        capacity_ah: float,
        initial_charge: float,
        factor: float,
    ) -> None:
        self._normals: Iterator[float] = standard_normals(generator)
        self._factor = factor
        self._capacity_ah = capacity_ah
        self._initial_charge = initial_charge
        self._consumed_ah = 0.0
        self._lost_charge = 0.0
        self._live_share = 1.0  # [-] Cells that give voltage, of all
        self.current_a = 0.0  # [A] Drawn from the pack
        self.voltage_v = 0.0  # [V] At the terminals
        self.draw(0.0, 0.0)

    @property
    def charge(self) -> float:
        """What is left, 0 empty to 1 full."""
        return max(
            0.0, self._initial_charge - self._lost_charge - self._consumed_ah / self._capacity_ah
        )

    def set_charge(self, charge: float) -> None:
        """Have `charge` left, 0 empty to 1 full, from now on."""
        self._lost_charge += self.charge - charge

    def fail_cells(self, cells: int, charge_lost: float) -> None:
        """Lose the voltage of `cells` short-circuited cells, and a share of the full charge."""
        self._live_share = max(0.0, self._live_share - cells / CELLS)
        self._lost_charge += charge_lost

    def draw(self, motor_power_w: float, duration_s: float) -> None:
        """Feed the motors and the avionics for `duration_s`."""
        if self.charge <= 0.0 or self._live_share <= 0.0:
            self.current_a, self.voltage_v = 0.0, 0.0
            return
        open_circuit_v = self._live_share * open_circuit_voltage_v(self.charge)
        self.current_a = current_for_power_a(motor_power_w + AVIONICS_POWER_W, open_circuit_v)
        self.voltage_v = open_circuit_v - self.current_a * INTERNAL_RESISTANCE_OHM
        self._consumed_ah += self.current_a * duration_s / _SECONDS_PER_HOUR

    def read(self, time_us: int) -> BatteryReading:
        """One sample of the monitor."""
        voltage_noise = VOLTAGE_SIGMA_V * self._factor * next(self._normals)
        current_noise = CURRENT_SIGMA_A * self._factor * next(self._normals)
        return BatteryReading(
            time_us,
            max(0.0, self.voltage_v + voltage_noise),
            max(0.0, self.current_a + current_noise),
        )
