"""Who leads the vehicle and how: sticks, streamed setpoints, and which loops are closed."""

from enum import IntEnum
from typing import NamedTuple, TypeAlias

from uav_firmware.msg.setpoints import (
    TrajectorySetpoint,
    VehicleAttitudeSetpoint,
    VehicleRatesSetpoint,
)


class ControlSource(IntEnum):
    """Which module writes the setpoints."""

    NAVIGATOR = 0
    MANUAL = 1  # manual_control, from sticks
    OFFBOARD = 2  # offboard, from a stream of setpoints


class ControlLevel(IntEnum):
    """The outermost loop that is closed; the source writes its setpoint."""

    POSITION = 0  # trajectory_setpoint
    ATTITUDE = 1  # vehicle_attitude_setpoint
    RATES = 2  # vehicle_rates_setpoint


class VehicleControlMode(NamedTuple):
    """Written by commander on change; read by navigator and by all who write setpoints."""

    time_us: int  # [us]
    source: ControlSource
    level: ControlLevel


class ManualControlSetpoint(NamedTuple):
    """Sticks, each -1..1 and 0 when centred. Written by mavlink."""

    time_us: int  # [us] When it arrived
    forward: float  # [-] Pitch stick; positive flies forward
    right: float  # [-] Roll stick; positive flies right
    up: float  # [-] Throttle stick; positive climbs
    yaw: float  # [-] Positive turns clockwise seen from above


OffboardSetpoint: TypeAlias = TrajectorySetpoint | VehicleAttitudeSetpoint | VehicleRatesSetpoint
"""A setpoint from outside, stamped with its arrival. Written by mavlink; its type is its level."""
