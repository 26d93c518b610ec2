"""Whether the vehicle is outside the geofence, or would stop outside it.

Where the navigator flies a route that was checked, a stop would keep to it, so it counts with the
vehicle's distance from the setpoint. Otherwise the stop is the vehicle's own: that of
`motion.stop_pieces` from the motion that it has after the reaction time.
"""

import itertools
import math
from typing import Final

from uav_firmware.lib.motion import MotionState, stop_pieces
from uav_firmware.lib.vector import ZERO, add, norm, scale, subtract
from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.msg.geofence import FenceAction, FenceBreach, GeofenceStatus
from uav_firmware.msg.vectors import Vector3

PERIOD_US: Final = 100_000  # [us] 10 Hz: a metre at 12 m/s, within the reaction time below
_REACTION_S: Final = 0.25  # [s] A period, the commander's step and the lag of attitude and thrust
_FOLLOWED_M: Final = 1.5  # [m] Farther from the setpoint the vehicle does not fly the route
_HARDEST_M_S2: Final = 6.0  # [m/s^2] With which a speed above the controller's limits is braked
_SAMPLED_SHARES: Final = (0.5, 1.0)  # Of each stretch of a stop


class GeofenceMonitor:
    """Checks ten times a second, and counts breaches."""

    def __init__(self) -> None:
        self.status: GeofenceStatus | None = None
        self._count = 0
        self._since_us = 0
        self._due_us = 0

    @property
    def alarmed(self) -> bool:
        """Whether the vehicle is outside, or would stop there."""
        status = self.status
        return status is not None and (
            status.breach is not FenceBreach.NONE or status.predicted is not FenceBreach.NONE
        )

    def update(self, flight: Flight, *, route_checked: bool) -> GeofenceStatus | None:
        """New status when one is due; None in between."""
        if flight.now_us < self._due_us or flight.estimate is None:
            return None
        self._due_us = flight.now_us + PERIOD_US
        breach = predicted = FenceBreach.NONE
        margin = math.inf
        if flight.estimate.position_valid:
            margin = flight.fence.margin((flight.position[0], flight.position[1]))
            if not flight.landed:
                breach, predicted = _check(flight, route_checked=route_checked)
        was = self.status.breach if self.status is not None else FenceBreach.NONE
        if breach is not FenceBreach.NONE and was is FenceBreach.NONE:
            self._count += 1
            self._since_us = flight.now_us
        action = FenceAction(flight.params.fence_action)
        self.status = GeofenceStatus(
            flight.now_us,
            breach,
            predicted,
            action,
            margin,
            self._count,
            self._since_us,
            flight.fence_enabled,
        )
        return self.status


def _check(flight: Flight, *, route_checked: bool) -> tuple[FenceBreach, FenceBreach]:
    fence, position = flight.fence, flight.position
    breach = fence.breach((position[0], position[1]), flight.height_of(position[2]))
    if breach is not FenceBreach.NONE or not flight.params.fence_prediction:
        return breach, breach
    way = [position, *_way_to_rest(flight, route_checked=route_checked)]
    for start, end in itertools.pairwise(way):
        there = (end[0], end[1])
        predicted = fence.breach(there, flight.height_of(end[2]))
        if predicted is not FenceBreach.NONE:
            return breach, predicted
        if not fence.line_allowed((start[0], start[1]), there):
            return breach, FenceBreach.BOUNDARY
    return breach, FenceBreach.NONE


def _way_to_rest(flight: Flight, *, route_checked: bool) -> list[Vector3]:
    """Points [m, NED] on the way of the vehicle after a command to stop; the last is the rest."""
    estimate = flight.estimate
    if estimate is None or not estimate.velocity_valid:
        return []
    off = subtract(estimate.position_ned, flight.path.state.position)
    if route_checked and norm(off) < _FOLLOWED_M:
        return [add(point, off) for point in flight.path.stop_points(flight.limits())]
    # The acceleration goes on until the order to stop takes effect.
    velocity = add(estimate.velocity_ned, scale(estimate.acceleration_ned, _REACTION_S))
    mean = scale(add(estimate.velocity_ned, velocity), 0.5)
    start = add(estimate.position_ned, scale(mean, _REACTION_S))
    slow, way = _within_limits(velocity, flight.ceiling)
    begin = MotionState(add(start, way), slow, ZERO)
    stop = stop_pieces(begin, flight.limits())
    rest = [
        piece.at(share * piece.duration).position for piece in stop for share in _SAMPLED_SHARES
    ]
    return [start, begin.position, *rest]


def _within_limits(velocity: Vector3, ceiling: Vector3) -> tuple[Vector3, Vector3]:
    """Velocity within the position controller's limits [m/s], and the way [m] until then.

    What is above them is braked by all tilt, or by all that gravity gives.
    """
    horizontal, up, down = ceiling
    speed = math.hypot(velocity[0], velocity[1])
    level = min(1.0, horizontal / speed) if speed > 0.0 else 1.0
    climb = min(max(velocity[2], -up), down)
    ways = (
        speed * speed * (1.0 - level * level),
        velocity[2] * abs(velocity[2]) - climb * abs(climb),
    )
    north, east = (velocity[0] / speed, velocity[1] / speed) if speed > 0.0 else (0.0, 0.0)
    run, rise = ways[0] / (2.0 * _HARDEST_M_S2), ways[1] / (2.0 * _HARDEST_M_S2)
    return (velocity[0] * level, velocity[1] * level, climb), (north * run, east * run, rise)
