"""The magnetometer at work: it gives the first heading, then keeps it."""

import math
from collections.abc import Sequence
from typing import Final

from uav_firmware.lib.rotation import from_euler, multiply
from uav_firmware.modules.estimator.bias_watch import HeadingWatch
from uav_firmware.modules.estimator.core import RESET_AFTER_S, Core
from uav_firmware.modules.estimator.ekf import Measurement
from uav_firmware.modules.estimator.fuse_mag import Compass, heading_measurement, read_compass
from uav_firmware.modules.estimator.gate import Aid
from uav_firmware.modules.estimator.params import EstimatorParams
from uav_firmware.modules.estimator.state import ATTITUDE, HEADING, HEADING_BIAS
from uav_firmware.msg.sensors import SensorMag

_INTERVAL_US: Final = 36_000  # As for the barometer
_UNKNOWN_SIGMA_RAD: Final = 1.8  # That of an even spread over the circle
_LARGEST_CHANGE: Final = 0.3  # [-] Of the field's strength since alignment


class CompassAiding:
    """Aligns the heading, fuses it, and survives a magnet nearby."""

    def __init__(self, params: EstimatorParams) -> None:
        self.heading = Aid(params.heading_gate)
        self.aligned = False
        self._watch = HeadingWatch()
        self._params = params
        self._strength = 0.0
        self._aligned_with = 0.0  # [rad] Declination

    def configure(self, params: EstimatorParams) -> None:
        """Work with changed parameters from now on."""
        self._params = params
        self.heading.gate = params.heading_gate

    def take(self, core: Core, mag: SensorMag) -> None:
        """Use a sample, if it is a field that the Earth could have."""
        if mag.time_us < self.heading.ready_us:
            return
        self.heading.ready_us = mag.time_us + _INTERVAL_US
        declination = self._declination(core)
        compass = read_compass(mag.field_frd, core.state.q_ned_frd, declination)
        if compass is None:
            return
        strength = math.hypot(*mag.field_frd)
        if not self.aligned or declination != self._aligned_with:
            # The first fix gives the declination while the vehicle is at rest
            self._strength, self._aligned_with = strength, declination
            self._align(core, compass)
        elif abs(strength - self._strength) <= _LARGEST_CHANGE * self._strength:
            self._fuse(core, compass)

    def is_current(self, core: Core) -> bool:
        """Whether the heading has been aligned, with the declination that is known now."""
        return self.aligned and self._aligned_with == self._declination(core)

    def _declination(self, core: Core) -> float:
        """Declination [rad] of the place, as far as it is known.

        Off the ground it stays that of the alignment, whatever a parameter or a first fix says:
        a hover looks like rest, and the heading of a vehicle that flies must not be turned.
        """
        if self.aligned and not core.standing:
            return self._aligned_with
        if self._params.declination_source == 0 or core.declination is None:
            return math.radians(self._params.declination_deg)
        return core.declination

    def _align(self, core: Core, compass: Compass) -> None:
        """Turn the estimate to the compass and forget all that was known of the heading."""
        state = core.state
        angle = compass.error - state.heading_bias
        state.q_ned_frd = multiply(from_euler(0.0, 0.0, angle), state.q_ned_frd)
        core.reset_log.note_turn(angle)
        core.ekf.forget(HEADING, _UNKNOWN_SIGMA_RAD)
        # Fusing what has just been set leaves the right correlation with the bias.
        core.ekf.fuse(self._measured(core, Compass(state.heading_bias, compass.tilt_gain)))
        self.aligned = True
        self._watch.restart()
        self.heading.accept(core.time_us)

    def _fuse(self, core: Core, compass: Compass) -> None:
        aid, now_us = self.heading, core.time_us
        measured = self._measured(core, compass)
        self._watch.look(core, measured[0])
        if aid.fuse(core.ekf, measured, now_us):
            return
        if aid.rejected_s(now_us) <= RESET_AFTER_S:
            return
        if core.standing:
            self._align(core, compass)
        else:
            # In flight GPS holds the heading: learn the compass anew rather than turn.
            core.state.heading_bias = compass.error
            core.ekf.forget(HEADING_BIAS, core.ekf.sigma(HEADING) + self._params.heading_noise)
            aid.accept(now_us)

    def _measured(self, core: Core, compass: Compass) -> Sequence[Measurement]:
        tilt_sigma = max(core.ekf.sigma(ATTITUDE.start), core.ekf.sigma(ATTITUDE.start + 1))
        return heading_measurement(
            compass, core.state.heading_bias, self._params.heading_noise, tilt_sigma
        )
