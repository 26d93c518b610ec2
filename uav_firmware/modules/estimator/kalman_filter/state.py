"""What is estimated: the nominal state and the layout of its error.

The nominal state is the present estimate; the error state is the small difference to the
truth, of which the covariance is kept (Sola 2017, section 5.1). The attitude error is global, a
rotation vector in NED on the left of the quaternion, q_true = exp(error) * q (Sola 2017,
section 7): an error of heading is then one component, whatever the attitude, and the compass
can be kept from disturbing roll and pitch.
"""

import math
from collections.abc import Sequence
from typing import Final

from uav_firmware.lib.rotation import IDENTITY, multiply, normalise
from uav_firmware.msg.vectors import Quaternion, Vector3

POSITION: Final = slice(0, 3)  # [m] NED about the origin
VELOCITY: Final = slice(3, 6)  # [m/s] NED
ATTITUDE: Final = slice(6, 9)  # [rad] NED rotation vector
ACCEL_BIAS: Final = slice(9, 12)  # [m/s^2] FRD
GYRO_BIAS: Final = slice(12, 15)  # [rad/s] FRD
BARO_BIAS: Final = 15  # [m] Barometric height above origin, minus true height
HEADING_BIAS: Final = 16  # [rad] Heading by compass minus true heading
GPS_HEIGHT_BIAS: Final = 17  # [m] Height by GPS above origin, minus true height
WIND: Final = slice(18, 20)  # [m/s] North, east: where the air goes to
SIZE: Final = 20

DOWN: Final = 2
HEADING: Final = 8


class NominalState:
    """The best estimate. Mutable: it is stepped at control rate."""

    __slots__ = (
        "accel_bias_frd",
        "baro_bias_m",
        "gps_height_bias_m",
        "gyro_bias_frd",
        "heading_bias",
        "position_ned",
        "q_ned_frd",
        "velocity_ned",
        "wind_ne",
    )

    def __init__(self, q_ned_frd: Quaternion = IDENTITY) -> None:
        self.q_ned_frd = q_ned_frd
        self.velocity_ned: Vector3 = (0.0, 0.0, 0.0)
        self.position_ned: Vector3 = (0.0, 0.0, 0.0)
        self.accel_bias_frd: Vector3 = (0.0, 0.0, 0.0)
        self.gyro_bias_frd: Vector3 = (0.0, 0.0, 0.0)
        self.baro_bias_m = 0.0
        self.gps_height_bias_m = 0.0
        self.heading_bias = 0.0
        self.wind_ne = (0.0, 0.0)

    def inject(self, error: Sequence[float]) -> None:
        """Add an estimated error (Sola 2017, section 6.2, attitude as in section 7)."""
        px, py, pz, vx, vy, vz, rx, ry, rz, ax, ay, az, gx, gy, gz, baro, heading, gps = error[:18]
        wind_north, wind_east = error[WIND]
        x, y, z = self.position_ned
        self.position_ned = (x + px, y + py, z + pz)
        x, y, z = self.velocity_ned
        self.velocity_ned = (x + vx, y + vy, z + vz)
        x, y, z = self.accel_bias_frd
        self.accel_bias_frd = (x + ax, y + ay, z + az)
        x, y, z = self.gyro_bias_frd
        self.gyro_bias_frd = (x + gx, y + gy, z + gz)
        self.baro_bias_m += baro
        self.heading_bias += heading
        self.gps_height_bias_m += gps
        north, east = self.wind_ne
        self.wind_ne = (north + wind_north, east + wind_east)
        half = (1.0, 0.5 * rx, 0.5 * ry, 0.5 * rz)
        self.q_ned_frd = normalise(multiply(half, self.q_ned_frd))

    def limit_biases(self, accel_limit: float, gyro_limit: float) -> None:
        """Keep the sensor biases within what the sensors can have [m/s^2], [rad/s]."""
        x, y, z = self.accel_bias_frd
        self.accel_bias_frd = (
            _clip(x, accel_limit),
            _clip(y, accel_limit),
            _clip(z, accel_limit),
        )
        x, y, z = self.gyro_bias_frd
        self.gyro_bias_frd = (_clip(x, gyro_limit), _clip(y, gyro_limit), _clip(z, gyro_limit))

    def is_finite(self) -> bool:
        """Whether no number of the state is NaN or infinite."""
        numbers = (
            *self.q_ned_frd,
            *self.velocity_ned,
            *self.position_ned,
            *self.accel_bias_frd,
            *self.gyro_bias_frd,
            self.baro_bias_m,
            self.heading_bias,
            self.gps_height_bias_m,
            *self.wind_ne,
        )
        return math.isfinite(sum(numbers))


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
