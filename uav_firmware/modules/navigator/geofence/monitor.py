"""Whether the vehicle is outside the geofence, or would stop outside it."""

import math
from typing import Final

from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.msg.geofence import FenceAction, FenceBreach, GeofenceStatus
from uav_firmware.msg.vectors import Vector3

PERIOD_US: Final = 100_000  # [us] 10 Hz: a metre at 12 m/s, within the reaction time below
_REACTION_S: Final = 0.3  # [s] Until the hold of a failsafe brakes
_REACTION_ON_ROUTE_S: Final = 0.1  # [s] On a route on which the navigator itself brakes
_STOP_SHARE: Final = 0.75  # Of v^2 / a: the distance of a stop from a steady speed
_STOP_SHARE_ON_ROUTE: Final = 0.5


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
    here = (position[0], position[1])
    breach = fence.breach(here, flight.height_of(position[2]))
    predicted = breach
    if breach is FenceBreach.NONE and flight.params.fence_prediction:
        stop = _stopping_point(flight, route_checked=route_checked)
        there = (stop[0], stop[1])
        predicted = fence.breach(there, flight.height_of(stop[2]))
        if predicted is FenceBreach.NONE and not fence.line_allowed(here, there):
            predicted = FenceBreach.BOUNDARY
    return breach, predicted


def _stopping_point(flight: Flight, *, route_checked: bool) -> Vector3:
    """Where the vehicle would come to rest [m, NED] after a command to stop."""
    reaction = _REACTION_ON_ROUTE_S if route_checked else _REACTION_S
    share = _STOP_SHARE_ON_ROUTE if route_checked else _STOP_SHARE
    north, east, down = flight.position
    if flight.estimate is None or not flight.estimate.velocity_valid:
        return (north, east, down)
    vn, ve, vd = flight.estimate.velocity_ned
    params = flight.params
    level = reaction + share * math.hypot(vn, ve) / params.acceleration_horizontal
    upright = reaction + share * abs(vd) / params.acceleration_up
    return (north + vn * level, east + ve * level, down + vd * upright)
