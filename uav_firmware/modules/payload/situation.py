"""State of the vehicle at one instant as the payload uses it, and outcomes of orders."""

import math
from typing import Final, NamedTuple

from uav_firmware.lib.geo import LocalFrame
from uav_firmware.lib.vector import norm, subtract
from uav_firmware.msg.payload import Controller
from uav_firmware.msg.setpoints import TrajectorySetpoint
from uav_firmware.msg.status import CommandResult, HomePosition, NavigationState
from uav_firmware.msg.vectors import Vector3

NOWHERE: Final[Vector3] = (math.nan, math.nan, math.nan)
_REST_M_S: Final = 0.1  # [m/s] A slower setpoint is at rest
_REST_M: Final = 0.1  # [m] From the place that it leads to
_BRAKING_M: Final = 6.0  # [m] Way in which a vehicle comes to rest from the speed of a mission


class Situation(NamedTuple):
    """State of the vehicle at one instant."""

    now_us: int  # [us]
    own: Controller  # Sender of the mission's orders
    heading: float  # [rad]
    position_ned: Vector3 | None  # [m] None while unknown
    frame: LocalFrame | None  # About the estimate's origin
    home: HomePosition | None
    state: NavigationState
    armed: bool
    setpoint: TrajectorySetpoint | None = None

    @property
    def mission_flown(self) -> bool:
        """Whether the vehicle flies its mission."""
        return self.armed and self.state is NavigationState.AUTO_MISSION

    @property
    def holds(self) -> bool:
        """Whether the vehicle holds its position: in hold, and its setpoint is at rest.

        By the setpoint, since gusts move a vehicle that hovers. On the ground it has no position.
        """
        return self._left_m == 0.0

    @property
    def comes_to_rest(self) -> bool:
        """Whether it holds its position, or is about to: it brakes, or has nearly arrived."""
        return self._left_m <= _BRAKING_M

    @property
    def _left_m(self) -> float:
        """How far its setpoint still leads [m]: 0 at rest, infinite in another mode than hold."""
        if self.state is not NavigationState.AUTO_LOITER:
            return math.inf
        setpoint = self.setpoint
        if not self.armed or setpoint is None or math.isnan(setpoint.position_ned[0]):
            return 0.0
        left_m = norm(subtract(setpoint.goal_ned, setpoint.position_ned))  # NaN without a goal
        if norm(setpoint.velocity_ned) > _REST_M_S:
            return max(_REST_M, left_m)
        return left_m if left_m > _REST_M else 0.0

    @property
    def ground_down(self) -> float | None:
        """Down coordinate [m] of level ground at the height of home."""
        return None if self.home is None else self.home.position_ned[2]

    def to_ned(
        self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float
    ) -> Vector3 | None:
        """Local position [m, NED]; altitude NaN means that of home. None while unknown."""
        if self.frame is None:
            return None
        if math.isnan(altitude_amsl_m):
            if self.home is None:
                return None
            altitude_amsl_m = self.home.altitude_amsl_m
        return self.frame.to_ned(latitude_deg, longitude_deg, altitude_amsl_m)

    def to_geodetic(self, position_ned: Vector3) -> Vector3:
        """Latitude, longitude [deg], altitude above mean sea level [m]; NaN while unknown."""
        return NOWHERE if self.frame is None else self.frame.to_geodetic(position_ned)


class Outcome(NamedTuple):
    """Result of an order."""

    result: CommandResult
    reason: str = ""  # Text for the operator, or empty


ACCEPTED: Final = Outcome(CommandResult.ACCEPTED)


def denied(reason: str) -> Outcome:
    """A parameter is invalid, or the sender has no control."""
    return Outcome(CommandResult.DENIED, reason)


def temporarily_rejected(reason: str) -> Outcome:
    """The order is valid but cannot be executed in the present state."""
    return Outcome(CommandResult.TEMPORARILY_REJECTED, reason)


def failed(reason: str) -> Outcome:
    """The order is valid but the vehicle cannot execute it."""
    return Outcome(CommandResult.FAILED, reason)
