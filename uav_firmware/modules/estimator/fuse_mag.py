"""Measurement model of the compass: h(x) = heading + heading_bias.

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

import numpy as np

from uav_firmware.lib.rotation import rotate, wrap_pi
from uav_firmware.modules.estimator.ekf import Measurement
from uav_firmware.modules.estimator.state import HEADING, HEADING_BIAS, SIZE
from uav_firmware.msg.vectors import Quaternion, Vector3

_FIELD_GAUSS: Final = (0.15, 0.85)  # Earth's field is 0.22 to 0.67 gauss
_LEAST_HORIZONTAL: Final = 0.1  # [-] Of the whole field; less gives no direction

_ROW: Final = np.zeros(SIZE)
_ROW[HEADING] = 1.0
_ROW[HEADING_BIAS] = 1.0


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
