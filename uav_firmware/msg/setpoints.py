"""Set-points from the navigator down to the motors, in the order they are refined."""

import math
from typing import NamedTuple

from uav_firmware.msg.vectors import Quaternion, Vector3


class TrajectorySetpoint(NamedTuple):
    """Where to be. Written by navigator, read by position_control. NaN means unset."""

    time_us: int  # [us]
    position_ned: Vector3  # [m] NaN axis: controlled by velocity alone
    velocity_ned: Vector3  # [m/s] Feed-forward where position is set
    acceleration_ned: Vector3  # [m/s^2] Feed-forward
    yaw: float  # [rad] NaN: keep
    yaw_rate: float  # [rad/s] Feed-forward
    goal_ned: Vector3 = (math.nan, math.nan, math.nan)  # [m] End of the leg; NaN: `position_ned`
    speed_max: float = math.inf  # [m/s] Of the whole velocity, also to make up for a lag


class VehicleAttitudeSetpoint(NamedTuple):
    """How to lean. Written by position_control, read by attitude_control."""

    time_us: int  # [us]
    q_ned_frd: Quaternion  # [-]
    yaw_rate: float  # [rad/s] Feed-forward about the world's down axis
    thrust: float  # [-] Collective, 0 to 1 along -z of the body


class VehicleRatesSetpoint(NamedTuple):
    """How fast to turn. Written by attitude_control, read by rate_control."""

    time_us: int  # [us]
    rate_frd: Vector3  # [rad/s]
    thrust: float  # [-] Collective, 0 to 1


class VehicleTorqueThrustSetpoint(NamedTuple):
    """Normalised torque and thrust. Written by rate_control, read by control_allocator."""

    time_us: int  # [us]
    torque_frd: Vector3  # [-] -1 to 1 about each body axis
    thrust: float  # [-] Collective, 0 to 1


class ControlAllocatorStatus(NamedTuple):
    """What could not be produced. Written by control_allocator, read by rate_control."""

    time_us: int  # [us]
    unallocated_torque_frd: Vector3  # [-] Wanted minus produced
    unallocated_thrust: float  # [-]
