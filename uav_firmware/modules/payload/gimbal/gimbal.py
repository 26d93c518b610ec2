"""The gimbal: where the camera points, within the rates and the range of its axes. Pure.

Roll and pitch are held against the horizon. Yaw is held against north (locked) or turns with
the vehicle. The mechanics are taken as fast enough to cancel the vehicle's own motion; what is
limited is the rate at which the camera turns on order. Yaw has a slip ring and no end.
"""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

from uav_firmware.lib.payload_rules import PITCH_MAX_DEG, PITCH_MIN_DEG
from uav_firmware.lib.rotation import from_euler, wrap_pi
from uav_firmware.modules.payload.camera.lens import direction_to
from uav_firmware.msg.vectors import Quaternion, Vector3

PITCH_MIN: Final = math.radians(PITCH_MIN_DEG)
PITCH_MAX: Final = math.radians(PITCH_MAX_DEG)
SETTLED: Final = math.radians(1.0)
"""[rad] Nearer than this the gimbal has arrived."""
_STEEP: Final = math.radians(85.0)


class Angles(NamedTuple):
    """Point to a pitch and a yaw; NaN keeps a part."""

    pitch: float  # [rad] Up is positive
    yaw: float  # [rad] From north when locked, else from the vehicle's heading
    locked: bool
    rate_pitch: float = math.inf  # [rad/s] At most
    rate_yaw: float = math.inf  # [rad/s]


class Rates(NamedTuple):
    """Turn at a rate until told otherwise or at the end of the range."""

    pitch: float  # [rad/s]
    yaw: float  # [rad/s] Clockwise
    locked: bool  # Against north, else against the vehicle


class Place(NamedTuple):
    """Look at a place."""

    position_ned: Vector3  # [m]


Aim: TypeAlias = Angles | Rates | Place

NEUTRAL: Final = Angles(0.0, 0.0, locked=False)
"""Level and ahead."""


@dataclass(slots=True)
class Gimbal:
    """Attitude, and the order that it follows."""

    pitch: float = 0.0  # [rad]
    yaw: float = 0.0  # [rad] From north
    rate_pitch: float = 0.0  # [rad/s]
    rate_yaw: float = 0.0  # [rad/s] Against north
    heading: float = 0.0  # [rad] Of the vehicle
    heading_rate: float = 0.0  # [rad/s]
    settled: bool = True
    reachable: bool = True  # The range of pitch holds what is asked for
    aim: Aim = NEUTRAL

    @property
    def locked(self) -> bool:
        """Whether yaw is held against north."""
        return isinstance(self.aim, Place) or self.aim.locked

    @property
    def q_ned_camera(self) -> Quaternion:
        """Optical axis forward, right, down to NED."""
        return from_euler(0.0, self.pitch, self.yaw)

    def follow(self, aim: Aim) -> None:
        """Take a new order; parts of it that are NaN stay as they are."""
        if isinstance(aim, Angles):
            now = self.yaw if aim.locked else wrap_pi(self.yaw - self.heading)
            pitch = self.pitch if math.isnan(aim.pitch) else aim.pitch
            aim = aim._replace(pitch=pitch, yaw=now if math.isnan(aim.yaw) else aim.yaw)
        elif isinstance(aim, Rates):
            zero = [0.0 if math.isnan(rate) else rate for rate in aim[:2]]
            aim = Rates(zero[0], zero[1], aim.locked)
        self.aim = aim
        self.settled = False

    def hold(self) -> None:
        """Stay as it points now, against north."""
        self.follow(Angles(math.nan, math.nan, locked=True))

    def update(
        self, heading: float, position_ned: Vector3 | None, rate_max: float, dt: float
    ) -> None:
        """Move on by `dt` [s] with a vehicle heading [rad] and position [m, NED]."""
        turned = wrap_pi(heading - self.heading)
        self.heading, self.heading_rate = heading, turned / dt
        before = (self.pitch, self.yaw)
        if not self.locked:
            self.yaw = wrap_pi(self.yaw + turned)
        pitch, yaw, rate_pitch, rate_yaw = self._wanted(position_ned, dt)
        within = min(max(pitch, PITCH_MIN), PITCH_MAX)
        self.reachable = abs(within - pitch) < SETTLED
        self.pitch += _limited(within - self.pitch, min(rate_pitch, rate_max) * dt)
        self.yaw = wrap_pi(
            self.yaw + _limited(wrap_pi(yaw - self.yaw), min(rate_yaw, rate_max) * dt)
        )
        off = max(abs(within - self.pitch), abs(wrap_pi(yaw - self.yaw)))
        self.settled = off < SETTLED
        self.rate_pitch = (self.pitch - before[0]) / dt
        self.rate_yaw = wrap_pi(self.yaw - before[1]) / dt

    def _wanted(self, position_ned: Vector3 | None, dt: float) -> tuple[float, float, float, float]:
        """Pitch and yaw from north [rad] to go to, and how fast at most [rad/s]."""
        aim = self.aim
        if isinstance(aim, Rates):
            return self.pitch + aim.pitch * dt, self.yaw + aim.yaw * dt, math.inf, math.inf
        if isinstance(aim, Place):
            if position_ned is None:
                return self.pitch, self.yaw, math.inf, math.inf
            pitch, yaw = direction_to(position_ned, aim.position_ned)
            # Straight below, a step of the vehicle turns the bearing by any angle.
            return pitch, self.yaw if pitch < -_STEEP else yaw, math.inf, math.inf
        yaw = aim.yaw if aim.locked else self.heading + aim.yaw
        return aim.pitch, yaw, aim.rate_pitch, aim.rate_yaw


def _limited(change: float, most: float) -> float:
    return min(max(change, -most), most)
