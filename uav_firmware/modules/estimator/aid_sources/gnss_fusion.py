"""Measurement model of the GNSS receiver: position and velocity at an earlier time.

Height has an error of its own that wanders slowly, the state `gps_height_bias`.

h(x) is the state `tau` ago (see `delay`). Its error follows by the inverse transition, with the
errors of attitude and accelerometer constant meanwhile, J the integral of the specific force
over the delay [m/s] and R the attitude:

    dv(t) = dv          + [J]x dtheta       + tau R da
    dp(t) = dp - tau dv - tau/2 [J]x dtheta - tau^2/2 R da

Both last parts matter, and only together: 0.12 s of gravity turned by one degree are 20 mm/s,
and at rest a tilt error that the bias makes up for must stay invisible. With either part alone
the filter seems to observe the tilt, and claims less uncertainty than it has.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from uav_firmware.lib.rotation import to_matrix
from uav_firmware.modules.estimator.kalman_filter.covariance import Measurement, jacobian
from uav_firmware.modules.estimator.kalman_filter.delay import Past
from uav_firmware.msg.sensors import FIX_3D, SensorGps
from uav_firmware.msg.vectors import Vector3

_LARGEST_BIAS_M_S2: Final = 25.0  # [m/s^2] That the inertial sensors may suddenly be wrong by
_LEAST_CHANGE_M_S: Final = 1.0  # [m/s] Noise of a receiver


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsRequirements:
    """How good a fix must be to be used."""

    satellites: int  # [-] At least
    horizontal_accuracy_m: float  # [m] At most, one sigma
    vertical_accuracy_m: float  # [m]
    speed_accuracy_m_s: float  # [m/s]


def is_sane(gps: SensorGps) -> bool:
    """Whether every number is finite and a place, a speed and an accuracy on this Earth.

    A receiver that does not know its accuracy sends 0.
    """
    numbers = (
        gps.latitude_deg,
        gps.longitude_deg,
        gps.altitude_amsl_m,
        *gps.velocity_ned,
        gps.horizontal_accuracy_m,
        gps.vertical_accuracy_m,
        gps.speed_accuracy_m_s,
    )
    return (
        all(math.isfinite(number) for number in numbers)
        and abs(gps.latitude_deg) < 89.9
        and abs(gps.longitude_deg) <= 180.0
        and abs(gps.altitude_amsl_m) < 20_000.0
        and max(abs(component) for component in gps.velocity_ned) < 200.0
        and min(numbers[6:]) > 0.0
    )


def is_good(gps: SensorGps, required: GpsRequirements) -> bool:
    """Whether a fix is sane and good enough to be used."""
    return (
        is_sane(gps)
        and gps.fix_type >= FIX_3D
        and gps.satellites_used >= required.satellites
        and gps.horizontal_accuracy_m <= required.horizontal_accuracy_m
        and gps.vertical_accuracy_m <= required.vertical_accuracy_m
        and gps.speed_accuracy_m_s <= required.speed_accuracy_m_s
    )


class VelocityPlausibility:
    """Whether the velocity of a fix has changed as that of a vehicle can.

    A receiver under interference can send any velocity with a small deviation. Its differences
    from the inertial sensors would be taken for a jump of their biases.
    """

    def __init__(self) -> None:
        self._former: tuple[float, ...] = ()  # [m/s] Innovations of the last fix
        self._former_us = 0

    def update(self, group: Sequence[Measurement], time_us: int) -> bool:
        """Compare the innovations [m/s] of a fix with those of the fix before."""
        innovations = tuple(measurement.innovation for measurement in group)
        former, self._former = self._former or innovations, innovations
        elapsed_s = (time_us - self._former_us) * 1e-6
        self._former_us = time_us
        changes = (abs(new - old) for new, old in zip(innovations, former, strict=True))
        return max(changes) <= _LEAST_CHANGE_M_S + _LARGEST_BIAS_M_S2 * elapsed_s


def position_measurements(
    past: Past,
    position_ned: Vector3,
    height_bias_m: float,
    sigma_horizontal: float,
    sigma_vertical: float,
) -> tuple[Measurement, Measurement, Measurement]:
    """North, east and down [m] of a fix against the position at its time of validity.

    `height_bias_m` [m, up] is what the height of the fix is estimated to be wrong by.
    """
    delay = past.delay_s
    ix, iy, iz = past.impulse_ned
    half, square = -0.5 * delay, -0.5 * delay**2
    by_north, by_east, by_down = to_matrix(past.q_ned_frd)
    to_north = jacobian(
        position=(1.0, 0.0, 0.0),
        velocity=(-delay, 0.0, 0.0),
        attitude=(0.0, half * -iz, half * iy),
        accel_bias=_scaled(square, by_north),
    )
    to_east = jacobian(
        position=(0.0, 1.0, 0.0),
        velocity=(0.0, -delay, 0.0),
        attitude=(half * iz, 0.0, half * -ix),
        accel_bias=_scaled(square, by_east),
    )
    to_down = jacobian(
        position=(0.0, 0.0, 1.0),
        velocity=(0.0, 0.0, -delay),
        attitude=(half * -iy, half * ix, 0.0),
        accel_bias=_scaled(square, by_down),
        gps_height_bias=-1.0,
    )
    north, east, down = position_ned
    past_north, past_east, past_down = past.position_ned
    horizontal = sigma_horizontal * sigma_horizontal
    return (
        Measurement(north - past_north, to_north, horizontal),
        Measurement(east - past_east, to_east, horizontal),
        Measurement(down + height_bias_m - past_down, to_down, sigma_vertical * sigma_vertical),
    )


def velocity_measurements(
    past: Past, velocity_ned: Vector3, sigma: float
) -> tuple[Measurement, Measurement, Measurement]:
    """Velocity [m/s, NED] of a fix against the velocity at its time of validity."""
    delay = past.delay_s
    ix, iy, iz = past.impulse_ned
    by_north, by_east, by_down = to_matrix(past.q_ned_frd)
    to_north = jacobian(
        velocity=(1.0, 0.0, 0.0),
        attitude=(0.0, -iz, iy),
        accel_bias=_scaled(delay, by_north),
    )
    to_east = jacobian(
        velocity=(0.0, 1.0, 0.0),
        attitude=(iz, 0.0, -ix),
        accel_bias=_scaled(delay, by_east),
    )
    to_down = jacobian(
        velocity=(0.0, 0.0, 1.0),
        attitude=(-iy, ix, 0.0),
        accel_bias=_scaled(delay, by_down),
    )
    north, east, down = velocity_ned
    past_north, past_east, past_down = past.velocity_ned
    variance = sigma * sigma
    return (
        Measurement(north - past_north, to_north, variance),
        Measurement(east - past_east, to_east, variance),
        Measurement(down - past_down, to_down, variance),
    )


def _scaled(factor: float, row: Vector3) -> Vector3:
    return (factor * row[0], factor * row[1], factor * row[2])
