"""The magnetometer: aligns the heading, then corrects it by h(x) = heading + heading_bias.

The measured field is turned into NED by the estimated attitude; there its horizontal part should
point to the declination D, so that the innovation is D - atan2(east, north) - heading_bias: the
heading drops out and no Euler angle is needed. `heading_bias` stands for a wrong declination
and for iron on board: without it the compass would pretend to be right on average.

A tilt error t turns the horizontal part by t times down/horizontal. It goes into the noise, not
into the Jacobian: the compass must not correct roll and pitch, where a magnet nearby would harm
most.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from uav_firmware.lib.rotation import from_euler, multiply, rotate, wrap_pi
from uav_firmware.modules.estimator.ekf_core import (
    AID_INTERVAL_US,
    RESET_AFTER_S,
    UNKNOWN_HEADING_SIGMA_RAD,
    EkfCore,
)
from uav_firmware.modules.estimator.fault_detection.gyro_bias_jump import HeadingMonitor
from uav_firmware.modules.estimator.kalman_filter.covariance import Measurement, jacobian
from uav_firmware.modules.estimator.kalman_filter.gate import Aid
from uav_firmware.modules.estimator.kalman_filter.state import ATTITUDE, HEADING, HEADING_BIAS
from uav_firmware.modules.estimator.params import EstimatorParams
from uav_firmware.msg.sensors import SensorMag
from uav_firmware.msg.vectors import Quaternion, Vector3

_LARGEST_CHANGE: Final = 0.3  # [-] Of the field's strength since alignment
_FIELD_GAUSS: Final = (0.15, 0.85)  # Earth's field is 0.22 to 0.67 gauss
_LEAST_HORIZONTAL: Final = 0.1  # [-] Of the whole field; less gives no direction

_ROW: Final = jacobian(attitude=(0.0, 0.0, 1.0), heading_bias=1.0)


class Compass(NamedTuple):
    """What a magnetometer sample says about the heading."""

    error: float  # [rad] To be added to the heading of the attitude used, biases aside
    tilt_gain: float  # [-] Heading error per tilt error


def read_compass(field_frd: Vector3, q_ned_frd: Quaternion, declination: float) -> Compass | None:
    """Compare the field with the attitude; None if it is no usable field of the Earth."""
    strength = math.sqrt(sum((component * component for component in field_frd), 0.0))
    if not _FIELD_GAUSS[0] < strength < _FIELD_GAUSS[1]:
        return None
    north, east, down = rotate(q_ned_frd, field_frd)
    horizontal = math.hypot(north, east)
    if horizontal < _LEAST_HORIZONTAL * strength:
        return None
    return Compass(wrap_pi(declination - math.atan2(east, north)), abs(down) / horizontal)


def heading_measurement(
    compass: Compass, heading_bias: float, sigma: float, tilt_sigma: float
) -> Sequence[Measurement]:
    """Heading by compass [rad], with one sigma of its own noise and of the tilt."""
    innovation = wrap_pi(compass.error - heading_bias)
    variance = sigma * sigma + (compass.tilt_gain * tilt_sigma) ** 2
    return (Measurement(innovation, _ROW, variance),)


class CompassAiding:
    """Aligns the heading, fuses it, and survives a magnet nearby."""

    def __init__(self, params: EstimatorParams) -> None:
        self.heading = Aid(params.heading_gate)
        self.aligned = False
        self._monitor = HeadingMonitor()
        self._params = params
        self._strength = 0.0
        self._aligned_with = 0.0  # [rad] Declination

    def configure(self, params: EstimatorParams) -> None:
        """Work with changed parameters from now on."""
        self._params = params
        self.heading.gate = params.heading_gate

    def update(self, core: EkfCore, mag: SensorMag) -> None:
        """Use a sample, if it is a field that the Earth could have."""
        if mag.time_us < self.heading.ready_us:
            return
        self.heading.ready_us = mag.time_us + AID_INTERVAL_US
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

    def is_current(self, core: EkfCore) -> bool:
        """Whether the heading has been aligned, with the declination that is known now."""
        return self.aligned and self._aligned_with == self._declination(core)

    def _declination(self, core: EkfCore) -> float:
        """Declination [rad] of the place, as far as it is known.

        Off the ground it stays that of the alignment, whatever a parameter or a first fix says:
        a hover looks like rest, and the heading of a vehicle that flies must not be turned.
        """
        if self.aligned and not core.standing:
            return self._aligned_with
        if self._params.declination_source == 0 or core.declination is None:
            return math.radians(self._params.declination_deg)
        return core.declination

    def _align(self, core: EkfCore, compass: Compass) -> None:
        """Turn the estimate to the compass and forget all that was known of the heading."""
        state = core.state
        angle = compass.error - state.heading_bias
        state.q_ned_frd = multiply(from_euler(0.0, 0.0, angle), state.q_ned_frd)
        core.reset_log.note_turn(angle)
        core.ekf.forget(HEADING, UNKNOWN_HEADING_SIGMA_RAD)
        # Fusing what has just been set leaves the right correlation with the bias.
        core.ekf.fuse(self._measured(core, Compass(state.heading_bias, compass.tilt_gain)))
        self.aligned = True
        self._monitor.restart()
        self.heading.accept(core.time_us)

    def _fuse(self, core: EkfCore, compass: Compass) -> None:
        aid, now_us = self.heading, core.time_us
        measured = self._measured(core, compass)
        self._monitor.update(core, measured[0])
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

    def _measured(self, core: EkfCore, compass: Compass) -> Sequence[Measurement]:
        tilt_sigma = max(core.ekf.sigma(ATTITUDE.start), core.ekf.sigma(ATTITUDE.start + 1))
        return heading_measurement(
            compass, core.state.heading_bias, self._params.heading_noise, tilt_sigma
        )
