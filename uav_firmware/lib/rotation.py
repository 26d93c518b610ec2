"""Rotations as unit quaternions on plain floats.

Convention (Sola 2017, "Quaternion kinematics for the error-state Kalman filter", section 1.2.2):
Hamilton, scalar first, right-handed, passive, local to global. `q_ned_frd` turns the components
of a vector in the body frame (forward, right, down) into its components in NED. Euler angles
are yaw, pitch, roll about z, y, x in that order (aerospace).

Plain tuples are used because numpy needs about 1 us per operation on arrays this small, several
times what the arithmetic costs here. Functions do not normalise unless they say so.
"""

import math
from typing import TypeAlias

from uav_firmware.msg.vectors import Quaternion, Vector3

Matrix3: TypeAlias = tuple[Vector3, Vector3, Vector3]
"""Three rows of three."""

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)

_TINY = 1e-9  # below it a direction is taken as undefined


def wrap_pi(angle: float) -> float:
    """Bring a finite angle [rad] into (-pi, pi]."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


def multiply(left: Quaternion, right: Quaternion) -> Quaternion:
    """Hamilton product (Sola 2017, eq. 12): first `right`, then `left`."""
    lw, lx, ly, lz = left
    rw, rx, ry, rz = right
    return (
        lw * rw - lx * rx - ly * ry - lz * rz,
        lw * rx + lx * rw + ly * rz - lz * ry,
        lw * ry - lx * rz + ly * rw + lz * rx,
        lw * rz + lx * ry - ly * rx + lz * rw,
    )


def conjugate(q: Quaternion) -> Quaternion:
    """Inverse of a unit quaternion."""
    return (q[0], -q[1], -q[2], -q[3])


def normalise(q: Quaternion) -> Quaternion:
    """Scale to unit length.

    Raises:
        ValueError: if the length is zero or not finite.
    """
    w, x, y, z = q
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if not 0.0 < norm < math.inf:
        raise ValueError(f"quaternion {q} has no direction")
    return (w / norm, x / norm, y / norm, z / norm)


def rotate(q: Quaternion, vector: Vector3) -> Vector3:
    """Turn a vector by q: with `q_ned_frd`, from the body frame into NED."""
    w, x, y, z = q
    vx, vy, vz = vector
    tx = 2.0 * (y * vz - z * vy)
    ty = 2.0 * (z * vx - x * vz)
    tz = 2.0 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )


def rotate_inverse(q: Quaternion, vector: Vector3) -> Vector3:
    """Turn a vector back: with `q_ned_frd`, from NED into the body frame."""
    w, x, y, z = q
    vx, vy, vz = vector
    tx = 2.0 * (z * vy - y * vz)
    ty = 2.0 * (x * vz - z * vx)
    tz = 2.0 * (y * vx - x * vy)
    return (
        vx + w * tx - y * tz + z * ty,
        vy + w * ty - z * tx + x * tz,
        vz + w * tz - x * ty + y * tx,
    )


def from_euler(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Quaternion of roll, pitch and yaw [rad]."""
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def to_euler(q: Quaternion) -> Vector3:
    """Roll, pitch and yaw [rad] of a unit quaternion; pitch within [-pi/2, pi/2]."""
    w, x, y, z = q
    sine_pitch = 2.0 * (w * y - x * z)
    if not -1.0 <= sine_pitch <= 1.0:
        sine_pitch = max(-1.0, min(1.0, sine_pitch))
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return (roll, math.asin(sine_pitch), yaw_of(q))


def yaw_of(q: Quaternion) -> float:
    """Heading of the body's x axis from north [rad], in (-pi, pi]."""
    w, x, y, z = q
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def rotate_by_yaw(forward: float, right: float, yaw: float) -> tuple[float, float]:
    """North and east components of a forward-right vector at a heading [rad]."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return (forward * cosine - right * sine, forward * sine + right * cosine)


def tilt_of(q: Quaternion) -> float:
    """Angle between the body's down axis and the world's [rad], 0 to pi."""
    _, x, y, _ = q
    return 2.0 * math.asin(min(1.0, math.sqrt(x * x + y * y)))


def to_matrix(q: Quaternion) -> Matrix3:
    """Rotation matrix of a unit quaternion (Sola 2017, eq. 115), row by row."""
    w, x, y, z = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def from_matrix(matrix: Matrix3) -> Quaternion:
    """Unit quaternion of a rotation matrix, dividing by its largest component (Shepperd 1978)."""
    x_row, y_row, z_row = matrix
    xx, xy, xz = x_row
    yx, yy, yz = y_row
    zx, zy, zz = z_row
    trace = xx + yy + zz
    if trace >= xx and trace >= yy and trace >= zz:
        q = (1.0 + trace, zy - yz, xz - zx, yx - xy)
    elif xx >= yy and xx >= zz:
        q = (zy - yz, 1.0 + xx - yy - zz, xy + yx, xz + zx)
    elif yy >= zz:
        q = (xz - zx, xy + yx, 1.0 - xx + yy - zz, yz + zy)
    else:
        q = (yx - xy, xz + zx, yz + zy, 1.0 - xx - yy + zz)
    return normalise(q if q[0] >= 0.0 else (-q[0], -q[1], -q[2], -q[3]))


def cross(left: Vector3, right: Vector3) -> Vector3:
    """Vector product."""
    return (
        left[1] * right[2] - left[2] * right[1],
        left[2] * right[0] - left[0] * right[2],
        left[0] * right[1] - left[1] * right[0],
    )


def from_thrust_direction_and_yaw(thrust_ned: Vector3, yaw: float) -> Quaternion:
    """Attitude whose body -z axis points along `thrust_ned` and whose heading is `yaw` [rad].

    The length of the vector does not matter; a zero vector means upright. For a thrust below
    the horizon the nose keeps to the side of `yaw`, as in a half loop; for an exactly
    horizontal thrust square to it the heading is undefined and the nose points up.
    """
    north, east, down = thrust_ned
    length = math.sqrt(north * north + east * east + down * down)
    if length < _TINY:
        return from_euler(0.0, 0.0, yaw)
    z_axis = (-north / length, -east / length, -down / length)
    right = (-math.sin(yaw), math.cos(yaw), 0.0)
    x_axis = cross(right, z_axis)
    if z_axis[2] < 0.0:
        x_axis = (-x_axis[0], -x_axis[1], -x_axis[2])
    x, y, z = x_axis
    norm = math.sqrt(x * x + y * y + z * z)
    x_axis = (x / norm, y / norm, z / norm) if norm > _TINY else (0.0, 0.0, -1.0)
    y_axis = cross(z_axis, x_axis)
    return from_matrix(
        (
            (x_axis[0], y_axis[0], z_axis[0]),
            (x_axis[1], y_axis[1], z_axis[1]),
            (x_axis[2], y_axis[2], z_axis[2]),
        )
    )
