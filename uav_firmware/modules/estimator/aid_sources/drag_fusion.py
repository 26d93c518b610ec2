"""Measurement model of the drag: what an accelerometer feels across the rotors' axis.

Rotors push along body z. Along x and y a multirotor feels the drag of its motion through the air
alone, opposing it, and the accelerometer's bias (P. Martin and E. Salaun, "The true role of
accelerometer feedback in quadrotor control", ICRA 2010; PX4 `drag_fusion.cpp`):

    f = -d(|u|) x.u + bias,        u = v - w, d = M + rho |u| / (2 B)

x is the body axis in NED, B its ballistic coefficient, v the velocity, w the wind, level. The
factor d is kept while the law is
linearised. A rotation error r turns the axis, x + r cross x, so that its row is -d (x cross u).
"""

import math
from typing import NamedTuple

from uav_firmware.lib.drag import DragModel
from uav_firmware.lib.rotation import rotate
from uav_firmware.modules.estimator.kalman_filter.covariance import Measurement, jacobian
from uav_firmware.modules.estimator.kalman_filter.state import NominalState
from uav_firmware.msg.vectors import Vector3

_AXES: tuple[Vector3, Vector3] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
_STILL_M_S = 0.01  # The factor below this airspeed is that of it


class Air(NamedTuple):
    """What the drag depends on besides the motion."""

    drag: DragModel
    density_kg_m3: float


def drag_measurements(
    state: NominalState, force_xy: tuple[float, float], air: Air, variance: float
) -> tuple[Measurement, Measurement]:
    """Specific force [m/s^2] along body x and y; `variance` is that of each [(m/s^2)^2]."""
    vx, vy, vz = state.velocity_ned
    wx, wy = state.wind_ne
    relative = (vx - wx, vy - wy, vz)
    speed = max(math.hypot(*relative), _STILL_M_S)
    factors = air.drag.factors_per_s(speed, air.density_kg_m3)
    along_x, along_y = (
        _along(state, index, measured, relative, factors[index], variance)
        for index, measured in enumerate(force_xy)
    )
    return along_x, along_y


def _along(
    state: NominalState,
    index: int,
    measured: float,
    relative: Vector3,
    factor: float,
    variance: float,
) -> Measurement:
    axis = rotate(state.q_ned_frd, _AXES[index])
    x, y, z = axis
    a, b, c = relative
    expected = state.accel_bias_frd[index] - factor * (x * a + y * b + z * c)
    row = jacobian(
        velocity=(-factor * x, -factor * y, -factor * z),
        attitude=(
            -factor * (y * c - z * b),
            -factor * (z * a - x * c),
            -factor * (x * b - y * a),
        ),
        accel_bias=_AXES[index],
        wind=(factor * x, factor * y),
    )
    return Measurement(measured - expected, row, variance)
