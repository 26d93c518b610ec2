"""The drag at work: with GPS it shows the wind, without GPS the wind shows the velocity.

The wind is a state that walks by EKF2_WIND_NSD. While GPS tells the velocity, the drag finds it;
when GPS is lost, the drag and the wind of that time keep the velocity from running away with the
tilt error (PX4: wind dead reckoning, `drag_fusion.cpp`). What the wind does afterwards cannot be
known: the uncertainty of the velocity grows with that of the wind.
"""

from typing import Final

from uav_firmware.lib.atmosphere import air_density, pressure_from_altitude
from uav_firmware.lib.drag import DragModel
from uav_firmware.modules.estimator.core import START_WIND_SIGMA_M_S, Core
from uav_firmware.modules.estimator.fuse_drag import Air, drag_measurements
from uav_firmware.modules.estimator.gate import Aid
from uav_firmware.modules.estimator.params import EstimatorParams
from uav_firmware.modules.estimator.state import DOWN, WIND
from uav_firmware.msg.vectors import Vector3

_SAMPLES: Final = 20  # Averaged: 80 ms at 250 Hz take the vibration out
_GATE: Final = 5.0

_ALTITUDES_M: Final = (-500.0, 10_000.0)  # Where a multirotor can be, whatever the estimate says
_AIR_TEMPERATURE_C: Final = 15.0  # 20 degrees beside it are 7 % of the drag


def density_at(altitude_amsl_m: float) -> float:
    """Density of the air [kg/m^3] at an estimated altitude."""
    lowest, highest = _ALTITUDES_M
    altitude_m = min(max(altitude_amsl_m, lowest), highest)
    return air_density(pressure_from_altitude(altitude_m), _AIR_TEMPERATURE_C)


class DragAiding:
    """Averages the specific force across the rotors' axis and fuses it in flight."""

    def __init__(self, drag: DragModel | None) -> None:
        self.force = Aid(_GATE)
        self.drag = drag  # None: coefficients are not known
        self.carried = False  # By the ground, which then holds against the wind
        self._restart()

    def _restart(self) -> None:
        self._x = self._y = 0.0
        self._count = 0

    def take(self, core: Core, force_frd: Vector3, params: EstimatorParams) -> None:
        """Take a sample of the accelerometer [m/s^2]."""
        if self.drag is None or not params.drag_control or core.origin is None:
            return
        if core.on_ground is not False:
            self._forget(core)
            return
        if self.carried:
            self._restart()
            return
        self._x += force_frd[0]
        self._y += force_frd[1]
        self._count += 1
        if self._count < _SAMPLES:
            return
        mean = (self._x / _SAMPLES, self._y / _SAMPLES)
        self._restart()
        altitude_m = core.origin.altitude_amsl_m - core.state.position_ned[DOWN]
        air = Air(self.drag, density_at(altitude_m))
        group = drag_measurements(core.state, mean, air, params.drag_noise)
        self.force.fuse(core.ekf, group, core.time_us)

    def _forget(self, core: Core) -> None:
        """On the ground the force is the ground's, and the wind of the last flight is gone."""
        self._restart()
        if self.force.fused_us is not None:
            self.force = Aid(_GATE)
            core.state.wind_ne = (0.0, 0.0)
            core.ekf.forget(WIND, START_WIND_SIGMA_M_S)
