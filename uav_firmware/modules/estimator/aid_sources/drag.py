"""The drag at work: with GPS it shows the wind, without GPS the wind shows the velocity.

The wind is a state that walks by EKF2_WIND_NSD. While GPS gives the velocity, the drag observes it;
when GPS is lost, the drag and the wind of that time keep the velocity from running away with the
tilt error (PX4: wind dead reckoning, `drag_fusion.cpp`). What the wind does afterwards cannot be
known: the uncertainty of the velocity grows with that of the wind.

What is known is that it dies towards the ground. While the vehicle reckons, the wind follows its
height h above the place of lift-off by the logarithmic law of the neutral surface layer,

    w(h) = w(h0) ln(h / z0) / ln(h0 / z0)

z0 the roughness of the ground, EKF2_WIND_Z0 (WMO-No. 8, Guide to Instruments, volume I, chapter 5:
0.03 m for open grass to 0.1 m for low crops; MIL-F-8785C, 3.7.3.4: 0.15 ft). Below h = LOWEST_M the
frame itself is among the roughness, and the wind is that of there. With GPS the drag shows what the
wind is at each height, and nothing is assumed.
"""

import math
from typing import Final

from uav_firmware.lib.atmosphere import density_at
from uav_firmware.lib.drag import DragModel
from uav_firmware.lib.rotation import rotate_inverse
from uav_firmware.modules.estimator.aid_sources.drag_fusion import Air, drag_measurements
from uav_firmware.modules.estimator.ekf_core import START_WIND_SIGMA_M_S, EkfCore
from uav_firmware.modules.estimator.kalman_filter.gate import Aid
from uav_firmware.modules.estimator.kalman_filter.state import DOWN, WIND, NominalState
from uav_firmware.modules.estimator.params import EstimatorParams
from uav_firmware.msg.vectors import Vector3

_SAMPLES: Final = 20  # Averaged: 80 ms at 250 Hz take the vibration out
_INTERVAL_S: Final = 0.08
_GATE: Final = 5.0
_GUST_SHARE: Final = 0.2  # [-] Of the mean wind, one sigma
_GUST_LENGTH_M: Final = 25.0  # Of horizontal gusts some metres above ground
_SLOWEST_M_S: Final = 1.0  # Below it a gust would never pass

LOWEST_M: Final = 0.5
"""[m] Height above the place of lift-off down to which the wind is taken to die."""

_LARGEST_SPEED_M_S: Final = 30.0  # Beyond it the estimate is nowhere, and no drag follows from it
_ALTITUDES_M: Final = (-500.0, 10_000.0)  # Where a multirotor can be, whatever the estimate says


def estimated_density(altitude_amsl_m: float) -> float:
    """Density of the air [kg/m^3] at an estimated altitude."""
    lowest, highest = _ALTITUDES_M
    return density_at(min(max(altitude_amsl_m, lowest), highest))


def wind_share(height_m: float, roughness_m: float) -> float:
    """Wind at a height above ground in units of the surface layer's own; 1 without roughness.

    Only the ratio of two heights means something. Heights up to the roughness, or below LOWEST_M,
    count as LOWEST_M.
    """
    if roughness_m <= 0.0:
        return 1.0
    return math.log(max(height_m, LOWEST_M) / roughness_m)


def gust_variance(state: NominalState, air: Air) -> float:
    """Variance [(m/s^2)^2] of the drag by gusts, as that of white noise of one mean.

    A gust of a fifth of the wind (MIL-F-8785C, 3.7.3: 0.2 of the wind near the ground) that is
    met at the airspeed V lasts GUST_LENGTH_M / V. Noise with that correlation time T weighs over
    longer times as white noise of 2 T / dt its variance does.
    """
    vx, vy, vz = state.velocity_ned
    wx, wy = state.wind_ne
    airspeed_m_s = max(math.hypot(vx - wx, vy - wy, vz), _SLOWEST_M_S)
    factor = max(air.drag.factors_per_s(airspeed_m_s, air.density_kg_m3))
    gust_m_s = _GUST_SHARE * math.hypot(wx, wy)
    white = 2.0 * _GUST_LENGTH_M / airspeed_m_s / _INTERVAL_S
    return white * (factor * gust_m_s) ** 2


class DragAiding:
    """Averages the specific force across the rotors' axis and fuses it in flight."""

    def __init__(self, drag: DragModel | None) -> None:
        self.force = Aid(_GATE)
        self.drag = drag  # None: coefficients are not known
        self.carried = False  # By the ground, which then holds against the wind
        self.reckoning = False  # Without a fix
        self._height_m: float | None = None  # Of the last wind while reckoning
        self._restart()

    def _restart(self) -> None:
        self._x = self._y = 0.0
        self._count = 0

    def update(
        self, core: EkfCore, force_frd: Vector3, turned_rad: float, params: EstimatorParams
    ) -> None:
        """Use a sample of the accelerometer [m/s^2], after a turn about the rotors' axis.

        What was summed up before turns the other way about the body, so that the mean is one in
        its present axes: on three rotors it spins by 80 degrees meanwhile.
        """
        if self.drag is None or not params.drag_control or core.origin is None:
            return
        if core.on_ground is not False:
            self._forget(core)
            return
        if self.carried:
            self._restart()
            return
        x, y = self._x, self._y
        self._x = x + turned_rad * y + force_frd[0]
        self._y = y - turned_rad * x + force_frd[1]
        self._count += 1
        if self._count < _SAMPLES:
            return
        mean = (self._x / _SAMPLES, self._y / _SAMPLES)
        self._restart()
        self._follow_height(core, params.wind_roughness_m)
        altitude_m = core.origin.altitude_amsl_m - core.state.position_ned[DOWN]
        air = Air(self.drag, estimated_density(altitude_m))
        variance = params.drag_noise + gust_variance(core.state, air)
        group = drag_measurements(core.state, mean, air, variance)
        self.force.fuse(core.ekf, group, core.time_us)

    def _follow_height(self, core: EkfCore, roughness_m: float) -> None:
        """Scale the stored wind to the present height."""
        height_m, former_m = -core.state.position_ned[DOWN], self._height_m
        self._height_m = height_m if self.reckoning else None
        if not self.reckoning or former_m is None:
            return
        share = wind_share(height_m, roughness_m) / wind_share(former_m, roughness_m)
        north, east = core.state.wind_ne
        core.state.wind_ne = (share * north, share * east)

    def model(self, core: EkfCore, force_frd: Vector3) -> Vector3:
        """Add the drag in the wind that is known to a modelled force [m/s^2] of the rotors."""
        drag, origin = self.drag, core.origin
        if drag is None or origin is None or core.on_ground is not False or self.carried:
            return force_frd
        state = core.state
        north, east, down = state.velocity_ned
        wind_north, wind_east = state.wind_ne
        motion = (north - wind_north, east - wind_east, down)
        speed = math.hypot(*motion)
        if not 0.0 < speed < _LARGEST_SPEED_M_S:  # NaN compares false
            return force_frd
        factor_x, factor_y = drag.factors_per_s(speed, estimated_density(origin.altitude_amsl_m))
        forward, right, _ = rotate_inverse(state.q_ned_frd, motion)
        return (-factor_x * forward, -factor_y * right, force_frd[2])

    def _forget(self, core: EkfCore) -> None:
        """On the ground the force is the ground's, and the wind of the last flight is gone."""
        self._restart()
        self._height_m = None
        if self.force.fused_us is not None:
            self.force = Aid(_GATE)
            core.state.wind_ne = (0.0, 0.0)
            core.ekf.forget(WIND, START_WIND_SIGMA_M_S)
