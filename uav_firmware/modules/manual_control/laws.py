"""What shaped sticks ask for: tilt, thrust, rates, climb speed. Pure.

Signs: the stick forward lowers the nose, right lowers the right side, up climbs, and yaw turns
clockwise seen from above. Frames: NED, FRD.
"""

import math
from typing import Final, NamedTuple

from uav_firmware.lib.rotation import from_thrust_direction_and_yaw
from uav_firmware.modules.manual_control.sticks import turned
from uav_firmware.msg.control_mode import ManualControlSetpoint
from uav_firmware.msg.vectors import Quaternion, Vector3

_GRAVITY: Final = 9.80665  # [m/s^2]
_THROTTLE_DOWN: Final = -0.9  # [-] At and below it a vehicle on the ground stands still


class ThrottleCurve(NamedTuple):
    """Thrust at the stick's ends and at its centre; full thrust is 1."""

    least: float  # [-] Down, in the air
    hover: float  # [-] Centred
    most: float  # [-] Up


class DescentSlope(NamedTuple):
    """How a descent slows down towards the ground."""

    high: float  # [m] Height above home from which it slows down
    low: float  # [m] Height at which it has slowed down
    fast: float  # [m/s]
    slow: float  # [m/s]

    def limit(self, height: float) -> float:
        """Largest sink speed [m/s] at a height [m]: a straight line between the two."""
        if height >= self.high or self.high <= self.low:
            return self.fast
        share = max(0.0, (height - self.low) / (self.high - self.low))
        return self.slow + share * max(self.fast - self.slow, 0.0)


def climb_velocity(up: float, speed_up: float, speed_down: float) -> float:
    """Vertical velocity [m/s, positive down] of the throttle stick."""
    return -up * (speed_up if up > 0.0 else speed_down)


def tilt_acceleration(forward: float, right: float, yaw: float, tilt_max: float) -> Vector3:
    """Horizontal acceleration [m/s^2, NED] that a tilt by the sticks gives."""
    share = math.hypot(forward, right)
    if share == 0.0:
        return (0.0, 0.0, 0.0)
    size = _GRAVITY * math.tan(share * tilt_max) / share
    north, east = turned(forward, right, yaw)
    return (north * size, east * size, 0.0)


def attitude(forward: float, right: float, yaw: float, tilt_max: float) -> Quaternion:
    """Attitude tilted by the sticks about a heading [rad]."""
    share = math.hypot(forward, right)
    tilt = share * tilt_max
    size = math.sin(tilt) / share if share > 0.0 else 0.0
    north, east = turned(forward, right, yaw)
    return from_thrust_direction_and_yaw((north * size, east * size, -math.cos(tilt)), yaw)


def thrust(up: float, curve: ThrottleCurve, *, landed: bool) -> float:
    """Collective thrust [-]: the centred stick hovers; on the ground the stick down is zero."""
    if landed and up <= _THROTTLE_DOWN:
        return 0.0
    end = curve.most if up > 0.0 else curve.least
    wanted = curve.hover + abs(up) * (end - curve.hover)
    return max(curve.least, min(curve.most, wanted))  # Rounding must not pass an end.


def body_rates(sticks: ManualControlSetpoint, rate_max_frd: Vector3) -> Vector3:
    """Body rates [rad/s, FRD] in acro mode."""
    roll, pitch, yaw = rate_max_frd
    return (sticks.right * roll, -sticks.forward * pitch, sticks.yaw * yaw)
