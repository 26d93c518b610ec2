"""Tells a failed motor by its speed: pure, one report of the speed controllers at a time.

A healthy rotor reaches the speed that belongs to its command within some tens of
milliseconds. The watch follows a lower bound of that speed, which rises more slowly than any
healthy rotor and falls more quickly, so that no manoeuvre brings a healthy rotor below it. A
rotor that turns at less than a share of the bound for a while has failed. Speed by command,
measured on the F450's motors and usual for a motor under a propeller's load:
n / n_full = 1.23 u - 0.23 u^2.
"""

from typing import Final, NamedTuple

from uav_firmware.msg.vectors import Motors

_RISE_TIME_S: Final = 0.15
_FALL_TIME_S: Final = 0.02
_LINEAR: Final = 1.23
_SQUARE: Final = 0.23


class MotorLimits(NamedTuple):
    """When a motor is too slow."""

    full_speed_rpm: float  # [1/min]
    least_command: float  # [-] Not judged below
    least_share: float  # [-] Of the speed expected
    time_s: float  # [s] That it must last


class MotorWatch:
    """Four rotors; a failed one stays failed until `reset`."""

    def __init__(self, limits: MotorLimits) -> None:
        self.limits = limits
        self.failed = 0  # [-] Bit 0 is motor 1
        self._bounds = [0.0, 0.0, 0.0, 0.0]
        self._slow_s = [0.0, 0.0, 0.0, 0.0]

    def reset(self) -> None:
        """Forget all: the motors stand."""
        self.failed = 0
        self._bounds = [0.0, 0.0, 0.0, 0.0]
        self._slow_s = [0.0, 0.0, 0.0, 0.0]

    def update(self, command: Motors, speed_rpm: Motors, dt: float) -> int:
        """Motors that have failed, as bits, after `dt` seconds with these commands."""
        limits, bounds = self.limits, self._bounds
        for motor in range(4):
            wanted = command[motor]
            steady = limits.full_speed_rpm * wanted * (_LINEAR - _SQUARE * wanted)
            time_s = _RISE_TIME_S if steady > bounds[motor] else _FALL_TIME_S
            bounds[motor] += (steady - bounds[motor]) * dt / (dt + time_s)
            # A report that is no number compares false and judges nothing
            slow = speed_rpm[motor] < limits.least_share * bounds[motor]
            if slow and wanted >= limits.least_command:
                self._slow_s[motor] += dt
                if self._slow_s[motor] >= limits.time_s:
                    self.failed |= 1 << motor
            else:
                self._slow_s[motor] = 0.0
        return self.failed
