"""The attitude law: a quaternion P controller that rights the thrust before the heading.

After D. Brescianini, M. Hehn, R. D'Andrea, "Nonlinear Quadrocopter Attitude Control", ETH
Zurich 2013. The error quaternion, seen from the body, is split into a swing, which turns the
thrust axis where it has to point, and a twist about that axis. A quadrotor has much less
torque about its thrust axis than across it, so only the share `yaw_weight` of the twist is
commanded together with the swing; the yaw gain is raised by the same factor, so that a pure
yaw error of a few degrees is corrected as if there were no weight.
"""

import math
from typing import NamedTuple

from uav_firmware.lib.rotation import rotate_inverse
from uav_firmware.msg.vectors import Quaternion, Vector3

_DOWN_NED: Vector3 = (0.0, 0.0, 1.0)
_DEGENERATE = 1e-6  # swing of half a turn: the twist is undefined


class AttitudeGains(NamedTuple):
    """Gains and limits of the attitude loop."""

    p_frd: Vector3  # [1/s] Body rate per rad of error
    yaw_weight: float  # [-] 0 to 1
    rate_limit_frd: Vector3  # [rad/s]


def error_quaternion(q_ned_frd: Quaternion, q_setpoint_ned_frd: Quaternion) -> Quaternion:
    """Rotation from the wanted to the present body axes, scalar part not negative.

    It is conjugate(q) * q_setpoint: the turn still to be made, seen from the body. Of the two
    quaternions of this turn the nearer one is given, so that the vehicle never unwinds.
    """
    w, x, y, z = q_ned_frd
    wanted_w, wanted_x, wanted_y, wanted_z = q_setpoint_ned_frd
    error_w = w * wanted_w + x * wanted_x + y * wanted_y + z * wanted_z
    error_x = w * wanted_x - x * wanted_w - y * wanted_z + z * wanted_y
    error_y = w * wanted_y + x * wanted_z - y * wanted_w - z * wanted_x
    error_z = w * wanted_z - x * wanted_y + y * wanted_x - z * wanted_w
    if error_w < 0.0:
        return (-error_w, -error_x, -error_y, -error_z)
    return (error_w, error_x, error_y, error_z)


def weighted_error(error: Quaternion, yaw_weight: float) -> Vector3:
    """Rotation vector [rad, FRD] of the swing and of the weighted twist, for small angles.

    Twice the vector part: proportional to the sine of half the angle, so it grows with the
    error all the way to half a turn.
    """
    w, x, y, z = error
    swing_w = math.hypot(w, z)
    if swing_w < _DEGENERATE:
        return (2.0 * x, 2.0 * y, 0.0)
    # error = swing * twist, twist = (w, 0, 0, z) / swing_w
    swing_x = (x * w - y * z) / swing_w
    swing_y = (y * w + x * z) / swing_w
    half_twist = yaw_weight * math.atan2(z, w)
    cosine = math.cos(half_twist)
    sine = math.sin(half_twist)
    return (
        2.0 * (swing_x * cosine + swing_y * sine),
        2.0 * (swing_y * cosine - swing_x * sine),
        2.0 * swing_w * sine,
    )


def rate_setpoint(
    q_ned_frd: Quaternion,
    q_setpoint_ned_frd: Quaternion,
    yaw_rate: float,
    gains: AttitudeGains,
) -> Vector3:
    """Body rates [rad/s, FRD] that bring the attitude to its setpoint.

    `yaw_rate` [rad/s] about the world's down axis is added as feed-forward.
    """
    error = weighted_error(error_quaternion(q_ned_frd, q_setpoint_ned_frd), gains.yaw_weight)
    p_roll, p_pitch, p_yaw = gains.p_frd
    rate_x = p_roll * error[0]
    rate_y = p_pitch * error[1]
    rate_z = p_yaw / gains.yaw_weight * error[2]
    if yaw_rate != 0.0:
        down = rotate_inverse(q_ned_frd, _DOWN_NED)
        rate_x += down[0] * yaw_rate
        rate_y += down[1] * yaw_rate
        rate_z += down[2] * yaw_rate
    limit_x, limit_y, limit_z = gains.rate_limit_frd
    if (
        -limit_x <= rate_x <= limit_x
        and -limit_y <= rate_y <= limit_y
        and -limit_z <= rate_z <= limit_z
    ):
        return (rate_x, rate_y, rate_z)
    return (
        min(max(rate_x, -limit_x), limit_x),
        min(max(rate_y, -limit_y), limit_y),
        min(max(rate_z, -limit_z), limit_z),
    )
