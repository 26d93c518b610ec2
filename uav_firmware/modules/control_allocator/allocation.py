"""The allocation law: torque and thrust to four motor thrusts, and to motor commands.

When the motors cannot give all, what keeps the vehicle upright comes first: thrust is shifted
so that roll and pitch fit, then yaw is cut, and only a roll and pitch torque that spans more
than the motors' whole range is scaled down. Full authority matters more than full thrust:
a quadrotor that tilts the wrong way loses more height than one that sinks for a moment.
"""

import math
from typing import Final

from farm_flight_bridge.native import mypyc_attr
from uav_firmware.lib.vector import ZERO
from uav_firmware.modules.control_allocator.geometry import Mix
from uav_firmware.msg.vectors import Motors, Vector3

_YAW_THRUST_MARGIN = 0.15  # [-] Thrust that may be moved to make room for yaw


@mypyc_attr(acyclic=True, free_list_len=1)
class Allocation:
    """What the motors do and what they could not do."""

    __slots__ = ("thrust", "unallocated_thrust", "unallocated_torque_frd")

    def __init__(
        self,
        thrust: Motors,  # [-] Of each motor, 0 to 1 of its own full thrust
        unallocated_torque_frd: Vector3,  # [-] Wanted minus produced
        unallocated_thrust: float,  # [-] Wanted minus produced
    ) -> None:
        self.thrust: Final = thrust
        self.unallocated_torque_frd: Final = unallocated_torque_frd
        self.unallocated_thrust: Final = unallocated_thrust


def allocate(torque_frd: Vector3, thrust: float, mix: Mix) -> Allocation:
    """Share normalised torque (-1..1) and thrust (0..1) among the motors."""
    roll, pitch, yaw = torque_frd
    one, two, three, four = mix
    a = thrust + one[0] * roll + one[1] * pitch + one[2] * yaw
    b = thrust + two[0] * roll + two[1] * pitch + two[2] * yaw
    c = thrust + three[0] * roll + three[1] * pitch + three[2] * yaw
    d = thrust + four[0] * roll + four[1] * pitch + four[2] * yaw
    if 0.0 <= a <= 1.0 and 0.0 <= b <= 1.0 and 0.0 <= c <= 1.0 and 0.0 <= d <= 1.0:
        return Allocation((a, b, c, d), ZERO, 0.0)
    return _desaturate(torque_frd, thrust, mix)


def _desaturate(torque_frd: Vector3, thrust: float, mix: Mix) -> Allocation:
    """The same where some motor would leave its range."""
    roll, pitch, yaw = torque_frd
    tilts = [row[0] * roll + row[1] * pitch for row in mix]
    lowest, highest = min(tilts), max(tilts)
    tilt_share = 1.0
    if highest - lowest > 1.0:
        tilt_share = 1.0 / (highest - lowest)
        tilts = [tilt * tilt_share for tilt in tilts]
        lowest *= tilt_share
        highest *= tilt_share
    level = min(max(thrust, -lowest), 1.0 - highest)
    turns = [row[2] * yaw for row in mix]
    level = _make_room_for_yaw(level, tilts, turns)
    yaw_share = _yaw_share(level, tilts, turns)
    motors = [
        min(max(level + tilt + yaw_share * turn, 0.0), 1.0)
        for tilt, turn in zip(tilts, turns, strict=True)
    ]
    return Allocation(
        (motors[0], motors[1], motors[2], motors[3]),
        ((1.0 - tilt_share) * roll, (1.0 - tilt_share) * pitch, (1.0 - yaw_share) * yaw),
        thrust - level,
    )


def _make_room_for_yaw(level: float, tilts: list[float], turns: list[float]) -> float:
    """Move the thrust, by a bounded amount, to where yaw fits best."""
    floor = max(-(tilt + turn) for tilt, turn in zip(tilts, turns, strict=True))
    ceiling = min(1.0 - tilt - turn for tilt, turn in zip(tilts, turns, strict=True))
    best = min(max(level, floor), ceiling) if floor <= ceiling else 0.5 * (floor + ceiling)
    moved = min(max(best, level - _YAW_THRUST_MARGIN), level + _YAW_THRUST_MARGIN)
    return min(max(moved, -min(tilts)), 1.0 - max(tilts))


def _yaw_share(level: float, tilts: list[float], turns: list[float]) -> float:
    """Largest share of the yaw torque, 0 to 1, that keeps every motor in range."""
    share = 1.0
    for tilt, turn in zip(tilts, turns, strict=True):
        if turn > 0.0:
            share = min(share, (1.0 - level - tilt) / turn)
        elif turn < 0.0:
            share = min(share, (level + tilt) / -turn)
    return max(share, 0.0)


def motor_commands(thrust: Motors, model_factor: float, idle: float) -> Motors:
    """Motor commands 0 to 1, none below `idle`, that give shares 0 to 1 of the full thrust.

    Inverts thrust = f u^2 + (1 - f) u, PX4's THR_MDL_FAC model of propeller and motor.
    """
    one, two, three, four = thrust
    if model_factor >= 1e-6:
        linear = 1.0 - model_factor
        square, double = linear * linear, 2.0 * model_factor
        one = (math.sqrt(square + 4.0 * model_factor * one) - linear) / double
        two = (math.sqrt(square + 4.0 * model_factor * two) - linear) / double
        three = (math.sqrt(square + 4.0 * model_factor * three) - linear) / double
        four = (math.sqrt(square + 4.0 * model_factor * four) - linear) / double
    if one >= idle and two >= idle and three >= idle and four >= idle:
        return (one, two, three, four)
    # max passes a first argument of NaN; the caller checks for it.
    return (max(one, idle), max(two, idle), max(three, idle), max(four, idle))
