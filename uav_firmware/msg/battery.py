"""State of the battery as the firmware estimates it."""

from typing import NamedTuple


class BatteryStatus(NamedTuple):
    """Written by battery at each sample; read by commander, mavlink and logger."""

    time_us: int  # [us] Of the sample
    voltage_v: float  # [V] At the pack, under load
    current_a: float  # [A] Drawn
    consumed_ah: float  # [Ah] Since boot, integrated current
    capacity_ah: float  # [Ah] Of the full pack, BAT1_CAPACITY
    remaining: float  # [-] Estimated charge, 0 empty to 1 full
