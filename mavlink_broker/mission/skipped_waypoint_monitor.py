"""Notices that another system set the vehicle on to a later item: what lies between was not flown.

MISSION_CURRENT beyond an item shows that it is done, but not how. A vehicle that was near its
waypoints, and then passes one that it was nowhere near, was ordered to. Nothing follows where
positions are missing, or before the vehicle was near a waypoint.
"""

from typing import Final

from afarcloud.geodesy import distance_m
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.planning.mission import FlightPlan
from mavlink_broker.vehicle.vehicle import Vehicle

NEAR_M: Final = 50.0
NEAR_S: Final = 3.0
"""Of flight at its speed: a plane turns early, and its positions are late."""
GAP_S: Final = 2.5
"""Without positions for so long the vehicle may have been anywhere."""


class SkippedWaypointMonitor:
    """Monitors one segment in flight."""

    def __init__(self, plan: FlightPlan, vehicle: Vehicle) -> None:
        self._plan = plan
        self._vehicle = vehicle
        self._unseen = {
            seq: item
            for seq, item in enumerate(plan.items)
            if seq >= plan.first_item and item.command == mavlink.MAV_CMD_NAV_WAYPOINT
        }
        self._current: int | None = None
        self._placed_at: float | None = None
        self._is_proven = False
        self._skipped: list[tuple[int, str]] = []

    def receive(self, message: Message, now: float) -> None:
        """Take a message of the vehicle."""
        match message.get_type():
            case "GLOBAL_POSITION_INT" if (message.lat, message.lon) != (0, 0):
                self._see_position(now)
            case "MISSION_ITEM_REACHED":
                self._unseen.pop(message.seq, None)
            case "MISSION_CURRENT":
                self._see_current(message.seq, now)

    def take_skipped(self) -> list[tuple[int, str]]:
        """Give, once, the commands that were not flown to their end, and why."""
        skipped, self._skipped = self._skipped, []
        return skipped

    def _see_position(self, now: float) -> None:
        if self._placed_at is not None and now - self._placed_at > GAP_S:
            self._lose_track()
        self._placed_at = now
        for seq in [seq for seq, item in self._unseen.items() if self._is_near(item)]:
            self._is_proven = self._is_proven or seq == self._current
            del self._unseen[seq]

    def _is_near(self, item: MissionItem) -> bool:
        position = self._vehicle.snapshot.position
        if position is None:
            return False
        away = distance_m(
            position.latitude_deg, position.longitude_deg, item.latitude_deg, item.longitude_deg
        )
        return away <= max(NEAR_M, item.parameters[1]) + NEAR_S * position.speed_m_s

    def _lose_track(self) -> None:
        """Take the current item as flown."""
        if self._current is not None:
            self._unseen.pop(self._current, None)
        self._current = None

    def _see_current(self, seq: int, now: float) -> None:
        if self._placed_at is None or now - self._placed_at > GAP_S:
            self._lose_track()
        before, self._current = self._current, seq
        if before is None or seq <= before or not self._vehicle.snapshot.armed:
            return
        left = [item for item in self._unseen if before <= item < seq]
        for item in left:
            del self._unseen[item]
        if self._is_proven and left:
            why = f"not flown: somebody else set the vehicle on from item {before} to item {seq}"
            commands = {self._plan.command_of_item[item] for item in left}
            self._skipped += [
                (command, why) for command in sorted(commands) if self._is_behind(command, seq)
            ]

    def _is_behind(self, command: int, seq: int) -> bool:
        return self._plan.done_item[command - self._plan.first_command] < seq
