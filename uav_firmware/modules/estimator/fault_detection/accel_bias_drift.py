"""Detects an accelerometer that drifts along x or y: slowly, so that nothing ever steps.

To a vehicle that hovers a lateral bias a looks like a tilt of a / g, and one that grows like a
gyroscope bias of its growth over g: GPS cannot separate them, and a filter that has learnt its
gyroscope to hundredths of a degree a second still has nothing else to correct. What separates
them is the force itself (P. Martin and E. Salaun, ICRA 2010, as in `lateral_force`):

    cause                    the filter turns the attitude     the lateral force, drag subtracted
    gyroscope drifts         by c, against the gyroscope       stays
    wind rises               no: the gyroscope has turned      changes by F
    accelerometer drifts     by c                              changes by F = g (c_y, -c_x)

c is what measurements have turned the attitude by, corrections of the gyroscope bias included,
that is by how far the attitude is from where the gyroscope with its former bias has it. Both c
and F are kept over the same time, with the same leak. When they are large and agree for a while,
the accelerometer has drifted, and the attitude is wrong by c.
"""

import math
from typing import Final

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.lib.rotation import rotate, rotate_inverse
from uav_firmware.lib.vector import ZERO
from uav_firmware.modules.estimator.ekf_core import EarlierEstimate, EkfCore
from uav_firmware.msg.vectors import Vector3

_MEMORY_S: Final = 20.0  # Less than _LEAST_M_S2 over it is the noise of a healthy vehicle
_USUAL_S: Final = 60.0  # Mean of bias and wind: what they were before
_LEAST_M_S2: Final = 0.3  # Measurements turn a healthy vehicle by a sixth of that
_AGREEMENT: Final = 0.5  # [-] Of the larger of the two, by which they may differ
_HELD_S: Final = 0.6
_SCALE_ERROR: Final = 0.02  # [-] Of the angle turned through: scale factor and misalignment
_WILD_RAD: Final = 2.0  # Turned through recently; nothing slow can be seen then
_WHOLE_TURN_RAD: Final = 2.0 * math.pi  # What a scale error adds up to in more turns is learnt


class AccelDriftDetector:
    """The two sums, and for how long they have agreed."""

    __slots__ = ("_agreed_s", "_corrections_ned", "_gyro_bias", "_manoeuvre_rad", "_slow",
                 "_time_us", "_turned_ned", "_wind_ne")  # fmt: skip

    def __init__(self) -> None:
        self._time_us: int | None = None  # None: begin anew
        self._turned_ned = ZERO
        self._corrections_ned = ZERO  # Those of the filter at the last look
        self._gyro_bias = ZERO
        self._wind_ne = (0.0, 0.0)
        self._slow = (0.0, 0.0, 0.0, 0.0)  # Means of the force and of the motion that drags
        self._agreed_s = 0.0
        self._manoeuvre_rad = 0.0  # Largest angle turned through, with the leak of the sums

    def restart(self) -> None:
        """Forget: on the ground, after an impact, or when the sensor has changed."""
        self._time_us = None
        self._manoeuvre_rad = 0.0

    def update(self, core: EkfCore) -> EarlierEstimate | None:
        """Some ten times a second in flight; the estimate to return to once it has drifted."""
        if core.recent_rotation.angle_rad > _WILD_RAD or core.impact.is_recent(core.time_us):
            manoeuvre_rad = max(self._manoeuvre_rad, core.recent_rotation.angle_rad)
            self.restart()
            self._manoeuvre_rad = min(manoeuvre_rad, _WHOLE_TURN_RAD)
            return None
        state, before_us = core.state, self._time_us
        self._time_us = core.time_us
        corrections, self._corrections_ned = self._corrections_ned, core.ekf.turned_ned
        if before_us is None:
            self._turned_ned, self._agreed_s = ZERO, 0.0
            self._gyro_bias, self._wind_ne = state.gyro_bias_frd, state.wind_ne
            self._slow = self._present(core)
            return None
        dt = (core.time_us - before_us) * 1e-6
        faded_rad = (1.0 - dt / _MEMORY_S) * self._manoeuvre_rad
        self._manoeuvre_rad = max(core.recent_rotation.angle_rad, faded_rad)
        self._add_turn(core, corrections, dt)
        present, share = self._present(core), dt / _MEMORY_S
        x, y, u, v = (new - old for new, old in zip(present, self._slow, strict=True))
        self._slow = tuple(
            old + share * (new - old) for new, old in zip(present, self._slow, strict=True)
        )  # type: ignore[assignment]  # four in, four out
        force = core.lateral.beside_drag((x, y), (u, v))
        self._agreed_s = self._agreed_s + dt if self._agrees(core, force) else 0.0
        if self._agreed_s < _HELD_S:
            return None
        return self.former

    @property
    def former(self) -> EarlierEstimate:
        """What the estimate was before, at the latest look."""
        return EarlierEstimate(self._turned_ned, self._gyro_bias, self._wind_ne)

    def _add_turn(self, core: EkfCore, corrections: Vector3, dt: float) -> None:
        """Add what measurements have turned the attitude by, at once and by the bias."""
        state, usual, leak = core.state, dt / _USUAL_S, 1.0 - dt / _MEMORY_S
        off = tuple(
            old - new for old, new in zip(self._gyro_bias, state.gyro_bias_frd, strict=True)
        )
        by_bias = rotate(state.q_ned_frd, (off[0], off[1], off[2]))
        x, y, z = (
            leak * old + new - before + dt * rate
            for old, new, before, rate in zip(
                self._turned_ned, core.ekf.turned_ned, corrections, by_bias, strict=True
            )
        )
        self._turned_ned = (x, y, z)
        x, y, z = self._gyro_bias
        self._gyro_bias = (x - usual * off[0], y - usual * off[1], z - usual * off[2])
        north, east = self._wind_ne
        self._wind_ne = (
            north + usual * (state.wind_ne[0] - north),
            east + usual * (state.wind_ne[1] - east),
        )

    def _present(self, core: EkfCore) -> tuple[float, float, float, float]:
        """Force along x and y [m/s^2], and motion in the usual wind along them [m/s]."""
        north, east, down = core.state.velocity_ned
        wind_north, wind_east = self._wind_ne
        forward, right, _ = rotate_inverse(
            core.state.q_ned_frd, (north - wind_north, east - wind_east, down)
        )
        return (*core.lateral.mean_m_s2, forward, right)

    def _agrees(self, core: EkfCore, force: tuple[float, float]) -> bool:
        """Whether the turn explains the change of force, and both are more than noise.

        The scale errors of a manoeuvre are learnt as gyroscope bias. The filter turns the attitude
        back while it unlearns them, for about as long as the sums remember.
        """
        x, y, _ = rotate_inverse(core.state.q_ned_frd, self._turned_ned)
        g = STANDARD_GRAVITY_M_S2
        sizes = (math.hypot(*force), g * math.hypot(x, y))
        least = _LEAST_M_S2 + _SCALE_ERROR * g * self._manoeuvre_rad
        apart = math.hypot(force[0] - g * y, force[1] + g * x)
        return min(sizes) > least and apart < _AGREEMENT * max(sizes)
