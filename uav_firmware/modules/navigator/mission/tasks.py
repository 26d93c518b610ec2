"""Tasks: each carries out one item of a mission until it is reached."""

import math
from typing import Protocol

from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.modules.navigator.mission.route import Route, radius_of
from uav_firmware.modules.navigator.modes.yaw_commands import start_turn
from uav_firmware.msg.mission import MissionCommand, MissionItem
from uav_firmware.msg.vectors import Vector3

_MISSED_BY_M = 3.0  # [m] Beyond the acceptance radius the waypoint is flown to again


class Task(Protocol):
    """An item that is carried out."""

    def step(self, flight: Flight) -> bool:
        """Whether the item is reached."""


class WaypointTask:
    """Flies through a waypoint, or stops at it for its hold time."""

    def __init__(self, item: MissionItem, route: Route) -> None:
        self._index = route.seqs.index(item.seq)
        waypoint = route.waypoints[self._index]
        self._position = waypoint.position
        self._stops = waypoint.tolerance <= 0.0
        self._item = item
        self._since_us: int | None = None  # Arrival
        hold = item.param1 if item.command != MissionCommand.NAV_LOITER_UNLIM else 0.0
        self._hold_s = 0.0 if math.isnan(hold) else hold

    def step(self, flight: Flight) -> bool:
        """Whether the waypoint has been passed, or held for long enough."""
        if self._since_us is None and not self._arrived(flight):
            return False
        if self._since_us is None:
            self._since_us = flight.now_us
        return flight.now_us - self._since_us >= round(self._hold_s * 1e6)

    def missed(self, flight: Flight) -> bool:
        """Whether the setpoint has passed the waypoint without the vehicle."""
        if self._stops or self._since_us is not None or flight.path.passed <= self._index:
            return False
        away = math.dist(flight.path.state.position, self._position)
        return away > radius_of(self._item, flight) + _MISSED_BY_M

    def _arrived(self, flight: Flight) -> bool:
        if flight.path.passed <= self._index:
            return False
        turned = not self._stops or flight.turned
        return turned and flight.arrived(self._position, radius_of(self._item, flight))


class DistanceTask:
    """CONDITION_DISTANCE: waits until the next position is near, or the setpoint at rest."""

    def __init__(self, item: MissionItem, goal: Vector3) -> None:
        self._distance = item.param1
        self._goal = goal

    def step(self, flight: Flight) -> bool:
        """Whether the vehicle is near enough."""
        return flight.path.resting or math.dist(flight.position, self._goal) <= self._distance


class TurnTask:
    """CONDITION_YAW: turns at the present position."""

    def __init__(self, item: MissionItem, flight: Flight) -> None:
        start_turn(
            flight,
            math.radians(item.param1),
            rate=math.radians(item.param2),
            direction=0 if math.isnan(item.param3) else int(item.param3),
            relative=item.param4 == 1.0,
        )

    def step(self, flight: Flight) -> bool:
        """Whether the turn is over."""
        return flight.landed or (flight.path.resting and flight.turned)


class ToAltitudeTask:
    """NAV_LOITER_TO_ALT: level to the position, then vertically to the altitude."""

    def __init__(self, flight: Flight, goal: Vector3) -> None:
        here = flight.rest_point()
        self._goal = goal
        flight.fly(flight.stop_at((goal[0], goal[1], here[2])), flight.stop_at(goal))

    def step(self, flight: Flight) -> bool:
        """Whether the altitude is reached at the position."""
        radius = flight.params.acceptance_radius
        return flight.path.resting and flight.arrived(self._goal, radius)


class DelayTask:
    """NAV_DELAY, CONDITION_DELAY: waits for a time, in the air or on the ground."""

    def __init__(self, item: MissionItem, flight: Flight) -> None:
        self._until_us = flight.now_us + round(max(item.param1, 0.0) * 1e6)

    def step(self, flight: Flight) -> bool:
        """Whether the time is over."""
        return flight.now_us >= self._until_us
