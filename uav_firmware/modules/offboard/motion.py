"""Flies a streamed setpoint directly or through a smoothly moving guide point. Pure.

The horizontal and the vertical part are treated separately:

    position alone        the guide moves there and stops, within the limits of missions
    velocity alone        the guide takes that velocity, and holds its position at zero
    anything else         passed on unchanged: position with velocity is a planned trajectory

Frames: NED, SI; NaN means unset.
"""

import math
from typing import Final, NamedTuple

from uav_firmware.lib.guide import Guide, GuideLimits, approach_speed
from uav_firmware.msg.setpoints import TrajectorySetpoint
from uav_firmware.msg.vectors import Vector3

_HORIZONTAL: Final[tuple[int, ...]] = (0, 1)
_VERTICAL: Final[tuple[int, ...]] = (2,)
_CLIMB_HEIGHT: Final = 0.3  # [m] A target this far above the ground means take-off
_CLIMB_SPEED: Final = 0.05  # [m/s]


class SpeedLimits(NamedTuple):
    """Speed limits towards a setpoint of position alone."""

    horizontal: float  # [m/s]
    up: float  # [m/s]
    down: float  # [m/s]


class Motion(NamedTuple):
    """Position, velocity and acceleration for the position controller; NaN means unset."""

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
) -> Motion:
    """Advance the guide by `dt` [s] and return the input of the position controller.

    `vehicle` is the vehicle's position [m, NED].
    """
    horizontal = _horizontal_velocity(setpoint, guide, limits, speeds)
    vertical = _vertical_velocity(setpoint, guide, limits, speeds)
    north, east = (0.0, 0.0) if horizontal is None else horizontal
    guide.advance((north, east, vertical or 0.0), vehicle, limits, dt)
    raw = frozenset(
        (_HORIZONTAL if horizontal is None else ()) + (_VERTICAL if vertical is None else ())
    )
    _reset_axes(guide, raw, vehicle)
    return Motion(
        _mixed(setpoint.position_ned, guide.position, raw),
        _mixed(setpoint.velocity_ned, guide.velocity, raw),
        _mixed(setpoint.acceleration_ned, guide.acceleration, raw),
    )


def wants_to_rise(setpoint: TrajectorySetpoint, vehicle: Vector3) -> bool:
    """Whether a setpoint leads up from the ground, which means take-off."""
    height = vehicle[2] - setpoint.position_ned[2]
    return (
        height > _CLIMB_HEIGHT
        or setpoint.velocity_ned[2] < -_CLIMB_SPEED
        or setpoint.acceleration_ned[2] < -_CLIMB_SPEED
    )


def _horizontal_velocity(
    setpoint: TrajectorySetpoint, guide: Guide, limits: GuideLimits, speeds: SpeedLimits
) -> tuple[float, float] | None:
    """Velocity [m/s] of the guide; None when the setpoint is passed on unchanged."""
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


def _vertical_velocity(
    setpoint: TrajectorySetpoint, guide: Guide, limits: GuideLimits, speeds: SpeedLimits
) -> float | None:
    """Velocity [m/s, down] of the guide; None when the setpoint is passed on unchanged."""
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


def _reset_axes(guide: Guide, raw: frozenset[int], vehicle: Vector3) -> None:
    """Keep the guide at the vehicle on the axes that it does not control."""
    if raw:
        zero = (0.0, 0.0, 0.0)
        guide.position = _mixed(vehicle, guide.position, raw)
        guide.velocity = _mixed(zero, guide.velocity, raw)
        guide.acceleration = _mixed(zero, guide.acceleration, raw)


def _mixed(on_raw: Vector3, otherwise: Vector3, raw: frozenset[int]) -> Vector3:
    if not raw:
        return otherwise
    north, east, down = (on_raw[i] if i in raw else otherwise[i] for i in range(3))
    return (north, east, down)
