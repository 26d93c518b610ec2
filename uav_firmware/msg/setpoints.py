"""Setpoints from the navigator down to the motors, in the order they are refined."""

import math
from typing import Final

from farm_flight_bridge.native import mypyc_attr
from uav_firmware.msg.vectors import Quaternion, Vector3


@mypyc_attr(acyclic=True, free_list_len=1)
class TrajectorySetpoint:
    """Where to be. Written by navigator, read by position_control. NaN means unset."""

    __slots__ = (
        "acceleration_ned",
        "goal_ned",
        "position_ned",
        "speed_max",
        "time_us",
        "velocity_ned",
        "yaw",
        "yaw_rate",
    )

    def __init__(
        self,
        time_us: int,  # [us]
        position_ned: Vector3,  # [m] NaN axis: controlled by velocity alone
        velocity_ned: Vector3,  # [m/s] Feed-forward where position is set
        acceleration_ned: Vector3,  # [m/s^2] Feed-forward
        yaw: float,  # [rad] NaN: keep
        yaw_rate: float,  # [rad/s] Feed-forward
        goal_ned: Vector3 = (
            math.nan,
            math.nan,
            math.nan,
        ),  # [m] End of the leg; NaN: `position_ned`
        speed_max: float = math.inf,  # [m/s] Of the whole velocity, also to make up for a lag
    ) -> None:
        self.time_us: Final = time_us
        self.position_ned: Final = position_ned
        self.velocity_ned: Final = velocity_ned
        self.acceleration_ned: Final = acceleration_ned
        self.yaw: Final = yaw
        self.yaw_rate: Final = yaw_rate
        self.goal_ned: Final = goal_ned
        self.speed_max: Final = speed_max


@mypyc_attr(acyclic=True, free_list_len=1)
class VehicleAttitudeSetpoint:
    """How to lean. Written by position_control, read by attitude_control."""

    __slots__ = ("q_ned_frd", "thrust", "time_us", "yaw_rate")

    def __init__(
        self,
        time_us: int,  # [us]
        q_ned_frd: Quaternion,  # [-]
        yaw_rate: float,  # [rad/s] Feed-forward about the world's down axis
        thrust: float,  # [-] Collective, 0 to 1 along -z of the body
    ) -> None:
        self.time_us: Final = time_us
        self.q_ned_frd: Final = q_ned_frd
        self.yaw_rate: Final = yaw_rate
        self.thrust: Final = thrust


@mypyc_attr(acyclic=True, free_list_len=1)
class VehicleRatesSetpoint:
    """How fast to turn. Written by attitude_control, read by rate_control."""

    __slots__ = ("rate_frd", "thrust", "time_us")

    def __init__(
        self,
        time_us: int,  # [us]
        rate_frd: Vector3,  # [rad/s]
        thrust: float,  # [-] Collective, 0 to 1
    ) -> None:
        self.time_us: Final = time_us
        self.rate_frd: Final = rate_frd
        self.thrust: Final = thrust


@mypyc_attr(acyclic=True, free_list_len=1)
class VehicleTorqueThrustSetpoint:
    """Normalised torque and thrust. Written by rate_control, read by control_allocator."""

    __slots__ = ("thrust", "time_us", "torque_frd")

    def __init__(
        self,
        time_us: int,  # [us]
        torque_frd: Vector3,  # [-] -1 to 1 about each body axis
        thrust: float,  # [-] Collective, 0 to 1
    ) -> None:
        self.time_us: Final = time_us
        self.torque_frd: Final = torque_frd
        self.thrust: Final = thrust


@mypyc_attr(acyclic=True, free_list_len=1)
class ControlAllocatorStatus:
    """What could not be produced. Written by control_allocator, read by rate_control."""

    __slots__ = ("time_us", "unallocated_thrust", "unallocated_torque_frd")

    def __init__(
        self,
        time_us: int,  # [us]
        unallocated_torque_frd: Vector3,  # [-] Wanted minus produced
        unallocated_thrust: float,  # [-]
    ) -> None:
        self.time_us: Final = time_us
        self.unallocated_torque_frd: Final = unallocated_torque_frd
        self.unallocated_thrust: Final = unallocated_thrust
