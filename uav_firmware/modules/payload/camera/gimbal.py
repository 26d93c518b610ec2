"""Attitude of the gimbal within its rates and range, and who may point it. Pure.

Roll and pitch are stabilised against the horizon. Yaw is held against north (locked) or turns with
the vehicle. The model cancels the vehicle's motion at once and limits the rate of ordered turns.
Yaw has a slip ring and no end stop.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

from uav_firmware.lib.payload_rules import PITCH_MAX_DEG, PITCH_MIN_DEG
from uav_firmware.lib.rotation import from_euler, wrap_pi
from uav_firmware.modules.payload.camera.lens import direction_to
from uav_firmware.msg.payload import Controller
from uav_firmware.msg.vectors import Quaternion, Vector3

PITCH_MIN: Final = math.radians(PITCH_MIN_DEG)
PITCH_MAX: Final = math.radians(PITCH_MAX_DEG)
SETTLED: Final = math.radians(1.0)
"""[rad] The gimbal has arrived when the error is smaller."""
_STEEP: Final = math.radians(85.0)
NO_CONTROLLER: Final = Controller(0, 0)
_UNCHANGED: Final = -1.0
_SENDER: Final = -2.0
_RELEASE: Final = -3.0


class Angles(NamedTuple):
    """Order to point to a pitch and a yaw; NaN keeps the present value."""

    pitch: float  # [rad] Up is positive
    yaw: float  # [rad] From north when locked, else from the vehicle's heading
    locked: bool
    rate_pitch: float = math.inf  # [rad/s] At most
    rate_yaw: float = math.inf  # [rad/s]


class Rates(NamedTuple):
    """Order to turn at a rate until the next order or the end of the range."""

    pitch: float  # [rad/s]
    yaw: float  # [rad/s] Clockwise
    locked: bool  # Against north, else against the vehicle


class Place(NamedTuple):
    """Order to look at a place."""

    position_ned: Vector3  # [m]


Aim: TypeAlias = Angles | Rates | Place

NEUTRAL: Final = Angles(0.0, 0.0, locked=False)
"""Level and forward."""


@dataclass(slots=True)
class Gimbal:
    """Attitude of the gimbal, and the order that it executes."""

    pitch: float = 0.0  # [rad]
    yaw: float = 0.0  # [rad] From north
    rate_pitch: float = 0.0  # [rad/s]
    rate_yaw: float = 0.0  # [rad/s] Against north
    heading: float = 0.0  # [rad] Of the vehicle
    heading_rate: float = 0.0  # [rad/s]
    settled: bool = True
    reachable: bool = True  # The ordered pitch is within the range
    aim: Aim = NEUTRAL

    @property
    def locked(self) -> bool:
        """Whether yaw is held against north."""
        return isinstance(self.aim, Place) or self.aim.locked

    @property
    def q_ned_camera(self) -> Quaternion:
        """Rotation from the camera frame (forward, right, down) to NED."""
        return from_euler(0.0, self.pitch, self.yaw)

    def follow(self, aim: Aim) -> None:
        """Apply a new order; NaN keeps the present value."""
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
        """Hold the present direction against north."""
        self.follow(Angles(math.nan, math.nan, locked=True))

    def update(
        self, heading: float, position_ned: Vector3 | None, rate_max: float, dt: float
    ) -> None:
        """Advance by `dt` [s] at a vehicle heading [rad] and position [m, NED]."""
        turned = wrap_pi(heading - self.heading)
        self.heading, self.heading_rate = heading, turned / dt
        before = (self.pitch, self.yaw)
        if not self.locked:
            self.yaw = wrap_pi(self.yaw + turned)
        pitch, yaw, rate_pitch, rate_yaw = self._target(position_ned, dt)
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

    def _target(self, position_ned: Vector3 | None, dt: float) -> tuple[float, float, float, float]:
        """Target pitch and yaw from north [rad], and their rate limits [rad/s]."""
        aim = self.aim
        if isinstance(aim, Rates):
            return self.pitch + aim.pitch * dt, self.yaw + aim.yaw * dt, math.inf, math.inf
        if isinstance(aim, Place):
            if position_ned is None:
                return self.pitch, self.yaw, math.inf, math.inf
            pitch, yaw = direction_to(position_ned, aim.position_ned)
            # Near the nadir the bearing is undefined
            return pitch, self.yaw if pitch < -_STEEP else yaw, math.inf, math.inf
        yaw = aim.yaw if aim.locked else self.heading + aim.yaw
        return aim.pitch, yaw, aim.rate_pitch, aim.rate_yaw


def _limited(change: float, most: float) -> float:
    return min(max(change, -most), most)


class GimbalControl(NamedTuple):
    """Primary and secondary controller, as in MAVLink's gimbal manager (services/gimbal_v2).

    A controller must take control before it points the gimbal; both controllers may point it.
    """

    primary: Controller = NO_CONTROLLER
    secondary: Controller = NO_CONTROLLER

    def may_point(self, sender: Controller) -> bool:
        """Whether a sender may point the gimbal."""
        return sender != NO_CONTROLLER and sender in {self.primary, self.secondary}

    def with_primary(self, sender: Controller) -> "GimbalControl":
        """Return the control with a sender as primary."""
        return self if sender == self.primary else self._replace(primary=sender)

    def configured(self, parameters: Sequence[float], sender: Controller) -> "GimbalControl":
        """Return the control after DO_GIMBAL_MANAGER_CONFIGURE with its parameters 1 to 4."""
        return GimbalControl(
            _assigned(self.primary, parameters[0], parameters[1], sender),
            _assigned(self.secondary, parameters[2], parameters[3], sender),
        )


def _assigned(
    present: Controller, system: float, component: float, sender: Controller
) -> Controller:
    if _SENDER in {system, component}:
        return sender
    if _RELEASE in {system, component}:
        return NO_CONTROLLER if present == sender else present
    if math.isnan(system) or system == _UNCHANGED:
        return present
    if system == 0.0:
        return NO_CONTROLLER
    kept = math.isnan(component) or component == _UNCHANGED
    return Controller(int(system), present.component_id if kept else int(component))
