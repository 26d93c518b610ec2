"""How a streamed motion is flown: as it is, or through a point that moves smoothly. Pure.

Horizontal and vertical parts are judged apart:

    position alone        the point flies there and stops, within the limits of missions
    velocity alone        the point takes that velocity, and holds its place at zero
    anything else         flown as it is: who sends velocity with position has planned it

Frames: NED, SI; NaN means unset.
"""

import math
from typing import Final, NamedTuple

from uav_firmware.lib.guide import Guide, GuideLimits, approach_speed
from uav_firmware.msg.setpoints import TrajectorySetpoint
from uav_firmware.msg.vectors import Vector3

_HORIZONTAL: Final[tuple[int, ...]] = (0, 1)
_VERTICAL: Final[tuple[int, ...]] = (2,)
_CLIMB_HEIGHT: Final = 0.3  # [m] A target this far above the ground is an order to take off
_CLIMB_SPEED: Final = 0.05  # [m/s]


class SpeedLimits(NamedTuple):
    """How fast a position alone is flown to."""

    horizontal: float  # [m/s]
    up: float  # [m/s]
    down: float  # [m/s]


class Wanted(NamedTuple):
    """Position, velocity and acceleration for the position controller."""

    position_ned: Vector3
    velocity_ned: Vector3
    acceleration_ned: Vector3


def follow(
    setpoint: TrajectorySetpoint,
    guide: Guide,
    vehicle: Vector3,
    limits: GuideLimits,
    speeds: SpeedLimits,
    dt: float,
) -> Wanted:
    """Let the point go `dt` [s] on; gives what the position controller shall do.

    `vehicle` is where the vehicle is [m].
    """
    horizontal = _wanted_horizontal(setpoint, guide, limits, speeds)
    vertical = _wanted_vertical(setpoint, guide, limits, speeds)
    north, east = (0.0, 0.0) if horizontal is None else horizontal
    guide.advance((north, east, vertical or 0.0), vehicle, limits, dt)
    raw = frozenset(
        (_HORIZONTAL if horizontal is None else ()) + (_VERTICAL if vertical is None else ())
    )
    _carry(guide, raw, vehicle)
    return Wanted(
        _mixed(setpoint.position_ned, guide.position, raw),
        _mixed(setpoint.velocity_ned, guide.velocity, raw),
        _mixed(setpoint.acceleration_ned, guide.acceleration, raw),
    )


def wants_to_rise(setpoint: TrajectorySetpoint, vehicle: Vector3) -> bool:
    """Whether a motion leads up from the ground: the order to take off."""
    height = vehicle[2] - setpoint.position_ned[2]
    return (
        height > _CLIMB_HEIGHT
        or setpoint.velocity_ned[2] < -_CLIMB_SPEED
        or setpoint.acceleration_ned[2] < -_CLIMB_SPEED
    )


def _wanted_horizontal(
    setpoint: TrajectorySetpoint, guide: Guide, limits: GuideLimits, speeds: SpeedLimits
) -> tuple[float, float] | None:
    """Velocity [m/s] of the point; None when the motion is flown as it is."""
    if not math.isnan(setpoint.acceleration_ned[0]):
        return None
    north, east = setpoint.velocity_ned[:2]
    if math.isnan(setpoint.position_ned[0]):
        return (north, east)
    if not math.isnan(north):
        return None
    ahead = (
        setpoint.position_ned[0] - guide.position[0],
        setpoint.position_ned[1] - guide.position[1],
    )
    distance = math.hypot(*ahead)
    if distance == 0.0:
        return (0.0, 0.0)
    speed = min(approach_speed(distance, limits.acceleration_horizontal), speeds.horizontal)
    return (ahead[0] * speed / distance, ahead[1] * speed / distance)


def _wanted_vertical(
    setpoint: TrajectorySetpoint, guide: Guide, limits: GuideLimits, speeds: SpeedLimits
) -> float | None:
    """Velocity [m/s, down] of the point; None when the motion is flown as it is."""
    if not math.isnan(setpoint.acceleration_ned[2]):
        return None
    velocity, position = setpoint.velocity_ned[2], setpoint.position_ned[2]
    if math.isnan(position):
        return velocity
    if not math.isnan(velocity):
        return None
    ahead = position - guide.position[2]
    if ahead < 0.0:
        return -min(approach_speed(-ahead, limits.acceleration_down), speeds.up)
    return min(approach_speed(ahead, limits.acceleration_up), speeds.down)


def _carry(guide: Guide, raw: frozenset[int], vehicle: Vector3) -> None:
    """Keep the point with the vehicle on the axes that it does not lead."""
    if raw:
        still = (0.0, 0.0, 0.0)
        guide.position = _mixed(vehicle, guide.position, raw)
        guide.velocity = _mixed(still, guide.velocity, raw)
        guide.acceleration = _mixed(still, guide.acceleration, raw)


def _mixed(on_raw: Vector3, otherwise: Vector3, raw: frozenset[int]) -> Vector3:
    if not raw:
        return otherwise
    north, east, down = (on_raw[i] if i in raw else otherwise[i] for i in range(3))
    return (north, east, down)
