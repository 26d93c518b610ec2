"""Tilt, thrust, body rates and climb speed from shaped sticks. Pure.

Signs: forward lowers the nose, right lowers the right side, up climbs, and positive yaw turns
clockwise seen from above. Frames: NED, FRD.
"""

import math
from typing import Final, NamedTuple

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.lib.rotation import from_thrust_direction_and_yaw, rotate_by_yaw
from uav_firmware.msg.control_mode import ManualControlSetpoint
from uav_firmware.msg.vectors import Quaternion, Vector3

_THROTTLE_DOWN: Final = -0.9  # [-] At or below it the thrust is zero on the ground


class ThrottleCurve(NamedTuple):
    """Thrust at the ends and the centre of the throttle stick; full thrust is 1."""

    least: float  # [-] Down, in the air
    hover: float  # [-] Centred
    most: float  # [-] Up


class DescentSlope(NamedTuple):
    """Sink speed limit by height above the ground."""

    high: float  # [m] At and above this height the limit is `fast`
    low: float  # [m] At and below this height the limit is `slow`
    fast: float  # [m/s]
    slow: float  # [m/s]
    braking: float  # [m/s^2] With which the vehicle slows down

    def limit(self, height: float) -> float:
        """Largest sink speed [m/s] at a height [m], interpolated linearly between the two.

        It is never so large that the vehicle could not slow down to `slow` before `low`.
        """
        way = max(0.0, height - self.low)
        sloped = self.fast
        if height < self.high:
            share = way / (self.high - self.low) if way > 0.0 else 0.0
            sloped = self.slow + share * max(self.fast - self.slow, 0.0)
        return min(sloped, math.sqrt(self.slow**2 + 2.0 * self.braking * way))


def climb_velocity(up: float, speed_up: float, speed_down: float) -> float:
    """Vertical velocity [m/s, positive down] for a throttle deflection, up positive."""
    return -up * (speed_up if up > 0.0 else speed_down)


def tilt_acceleration(forward: float, right: float, yaw: float, tilt_max: float) -> Vector3:
    """Acceleration [m/s^2, NED] of the tilt for a stick deflection; horizontal."""
    share = math.hypot(forward, right)
    if share == 0.0:
        return (0.0, 0.0, 0.0)
    size = STANDARD_GRAVITY_M_S2 * math.tan(share * tilt_max) / share
    north, east = rotate_by_yaw(forward, right, yaw)
    return (north * size, east * size, 0.0)


def attitude(forward: float, right: float, yaw: float, tilt_max: float) -> Quaternion:
    """Attitude for a stick deflection at a heading [rad]."""
    share = math.hypot(forward, right)
    tilt = share * tilt_max
    size = math.sin(tilt) / share if share > 0.0 else 0.0
    north, east = rotate_by_yaw(forward, right, yaw)
    return from_thrust_direction_and_yaw((north * size, east * size, -math.cos(tilt)), yaw)


def thrust(up: float, curve: ThrottleCurve, *, landed: bool) -> float:
    """Collective thrust [-]: hover at the centre; zero on the ground with the stick down."""
    if landed and up <= _THROTTLE_DOWN:
        return 0.0
    end = curve.most if up > 0.0 else curve.least
    value = curve.hover + abs(up) * (end - curve.hover)
    return max(curve.least, min(curve.most, value))  # Rounding must not exceed a limit


def body_rates(sticks: ManualControlSetpoint, rate_max_frd: Vector3) -> Vector3:
    """Body rates [rad/s, FRD] in acro mode."""
    roll, pitch, yaw = rate_max_frd
    return (sticks.right * roll, -sticks.forward * pitch, sticks.yaw * yaw)
