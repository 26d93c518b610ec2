"""Rotations as axis times angle, to build turns and to measure errors of attitude with.

Convention of `uav_firmware/lib/rotation.py` (Sola 2017, "Quaternion kinematics for the
error-state Kalman filter").
"""

import math
from typing import Final

from uav_firmware.msg.vectors import Quaternion, Vector3

_SMALL_ANGLE: Final = 1e-4  # [rad] Below it the series of sin(x)/x is exact to double precision
_UNDEFINED_AXIS: Final = 1e-9  # [-] Below it a quaternion's vector part has no direction


def from_rotation_vector(rotation: Vector3) -> Quaternion:
    """Exponential map (Sola 2017, eq. 101): axis times angle [rad] to unit quaternion."""
    x, y, z = rotation
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < _SMALL_ANGLE:
        scale = 0.5 - angle * angle / 48.0
        return (1.0 - angle * angle / 8.0, scale * x, scale * y, scale * z)
    scale = math.sin(0.5 * angle) / angle
    return (math.cos(0.5 * angle), scale * x, scale * y, scale * z)


def to_rotation_vector(q: Quaternion) -> Vector3:
    """Logarithmic map (Sola 2017, eq. 105): axis times angle, the shorter way round [rad]."""
    w, x, y, z = q if q[0] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 if sine < _UNDEFINED_AXIS else 2.0 * math.atan2(sine, w) / sine
    return (scale * x, scale * y, scale * z)
