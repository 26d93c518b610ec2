"""Parameters of the stick setpoints, in radians and grouped by use.

Limits that other modules declare (climb speed, hover thrust, acceleration) are read by name, so
that sticks and missions share them.
"""

import math
from typing import Final, NamedTuple

from uav_firmware.lib.guide import VERTICAL_LEASH_M, GuideLimits
from uav_firmware.modules.manual_control.params import ManualControlParams
from uav_firmware.modules.manual_control.stick_setpoints import DescentSlope, ThrottleCurve
from uav_firmware.modules.manual_control.stick_shaping import Curves
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry

_BRAKING_SHARE: Final = 0.5  # Of MPC_ACC_UP_MAX: jerk and lag take the rest


class Tuning(NamedTuple):
    """Inputs of the stick setpoints other than sticks and estimate."""

    curves: Curves
    speed_max: float  # [m/s]
    speed_up: float  # [m/s]
    descent: DescentSlope
    guide: GuideLimits
    tilt_max: float  # [rad]
    yaw_rate_max: float  # [rad/s]
    throttle: ThrottleCurve
    acro_rates_frd: Vector3  # [rad/s]
    acro_expo: float  # [-]
    acro_yaw_expo: float  # [-]
    stale_us: float  # [us] Sticks older than this count as centred
    spool_up_us: float  # [us]


def tuning_from(registry: Registry) -> Tuning:
    """Read the current parameters.

    Raises:
        UnknownParameterError: if a parameter of another module has not been declared.
    """
    own, get = registry.read(ManualControlParams), registry.get
    return Tuning(
        curves=Curves(own.dead_zone, own.horizontal_expo, own.vertical_expo, own.yaw_expo),
        speed_max=min(own.speed_max, get("MPC_XY_VEL_MAX")),
        speed_up=get("MPC_Z_VEL_MAX_UP"),
        descent=DescentSlope(
            high=own.slow_from_height,
            low=get("MPC_LAND_ALT2"),
            fast=get("MPC_Z_VEL_MAX_DN"),
            slow=get("MPC_LAND_SPEED"),
            braking=_BRAKING_SHARE * get("MPC_ACC_UP_MAX"),
        ),
        guide=GuideLimits(
            acceleration_horizontal=get("MPC_ACC_HOR"),
            acceleration_up=get("MPC_ACC_UP_MAX"),
            acceleration_down=get("MPC_ACC_DOWN_MAX"),
            jerk=own.jerk_max,
            leash_horizontal=get("MPC_XY_ERR_MAX"),
            leash_vertical=VERTICAL_LEASH_M,
        ),
        tilt_max=math.radians(own.tilt_max_deg),
        yaw_rate_max=math.radians(own.yaw_rate_max_deg_s),
        throttle=ThrottleCurve(own.thrust_min, get("MPC_THR_HOVER"), get("MPC_THR_MAX")),
        acro_rates_frd=(
            math.radians(own.acro_roll_rate_deg_s),
            math.radians(own.acro_pitch_rate_deg_s),
            math.radians(own.acro_yaw_rate_deg_s),
        ),
        acro_expo=own.acro_expo,
        acro_yaw_expo=own.acro_yaw_expo,
        stale_us=get("COM_RC_LOSS_T") * 1e6,
        spool_up_us=get("COM_SPOOLUP_TIME") * 1e6,
    )
