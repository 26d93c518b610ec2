"""Whether a mission is flown as it was uploaded: its items changed, set back or skipped by others.

Or without the geofence under which it began.

Vehicles that give ids to their missions show a change at once. Of the others only signs are seen:
another count of items, the acknowledgement of somebody's upload, the vehicle's STATUSTEXT, an item
number that goes back. None of them proves anything, so the mission is read back and compared. The
same mission with an earlier item current was set back by another ground station: it flies on, its
report notes it. PX4 does so by itself when it resumes a mission that has taken pictures: it begins
again at the place before. An earlier run of the broker has reported which items were reached, so a
vehicle that was set back while no broker ran is found too.

A skipped item: MISSION_CURRENT beyond an item shows that it is done, but not how. A vehicle that
was near its waypoints, and then passes one that it was nowhere near, was ordered to. Nothing
follows where positions are missing, or before the vehicle was near a waypoint.
"""

import math
from typing import Final

from afarcloud.geodesy import distance_m
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.autopilots.status_texts import TextMeaning, means
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.mission_download import Different, MissionVerify, Verified
from mavlink_broker.mission import exchanges
from mavlink_broker.planning.mission import FlightPlan
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.vehicle import Vehicle

QUIET_S: Final = 1.5
"""After the last frame of a transfer the mission is read back."""
BACK_FOR_S: Final = 1.5
"""How long an earlier item must be current: frames arrive out of order."""
READS: Final = 3
"""How often the mission is read back; a vehicle that does not answer is taken to fly on."""
NO_TOTALS: Final = frozenset({0, 0xFFFF})
CLEARED: Final = "cleared the mission from the vehicle"
_FENCES: Final = frozenset({mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_MISSION_TYPE_ALL})
_TRANSFER: Final = frozenset({"MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"})
NEAR_M: Final = 50.0
NEAR_S: Final = 3.0
"""Added to the distance as flight time: a plane turns early, and its positions are late."""
GAP_S: Final = 2.5
"""After a longer gap between positions the vehicle may have been anywhere."""


def foreign_uploader(message: Message, vehicle: Vehicle) -> int | None:
    """Give the system whose mission a vehicle takes, by its requests and answers; else None."""
    if message.get_type() not in _TRANSFER or vehicle.route.is_for_us(message):
        return None
    is_mission = getattr(message, "mission_type", 0) == mavlink.MAV_MISSION_TYPE_MISSION
    is_end = message.get_type() == "MISSION_ACK"
    if not is_mission or (is_end and message.type != mavlink.MAV_MISSION_ACCEPTED):
        return None
    return int(message.target_system)


def total_of(message: Message) -> int | None:
    """Give the number of items that a vehicle reports to hold; None if it reports none."""
    is_known = message.get_type() == "MISSION_CURRENT" and message.total not in NO_TOTALS
    return int(message.total) if is_known else None


def fence_change_of(message: Message, vehicle: Vehicle, now: float) -> str | None:
    """Describe what another system has done to the geofence, by the answer to it; None: nothing.

    An answer to DO_FENCE_ENABLE does not show whether it was enabled or disabled.
    """
    system, kind = vehicle.route.other_addressee(message), message.get_type()
    is_end = kind == "MISSION_ACK" and message.type == mavlink.MAV_MISSION_ACCEPTED
    if system is not None and is_end and getattr(message, "mission_type", 0) in _FENCES:
        return f"system {system} has changed the geofence of the vehicle"
    order = control_authority.order_of_another(message, vehicle.route, now)
    if order is not None and order.command == mavlink.MAV_CMD_DO_FENCE_ENABLE:
        return f"system {system} has switched the geofence of the vehicle on or off"
    return None


class MissionChangeMonitor:
    """Monitors one segment in flight."""

    def __init__(
        self,
        plan: FlightPlan,
        vehicle: Vehicle,
        reached: int,
        *,
        uploader: int | None,
        total: int | None,
    ) -> None:
        """Begin behind the last item that is known to be `reached`; -1: none.

        `uploader` has put a mission onto the vehicle since the items were verified; `total` is
        the first that the vehicle has sent since then. None: none.
        """
        self._plan = plan
        self._vehicle = vehicle
        self._total = total
        self._highest = reached
        self._back_since: float | None = None
        self._back_at = -1
        self._was_left = reached >= 0  # The mission mode, since its farthest item was current
        self._is_back_reported = False
        self._suspected_at: float | None = None if uploader is None else -math.inf
        self._uploader = uploader
        self._reads = 0
        self._reading: MissionVerify | None = None
        self.loss_reason: str | None = None
        self.holds_another = False  # It holds the mission of another system, rather than none
        self.note: str | None = None  # What somebody has changed of a mission that still flies

    @property
    def is_suspicious(self) -> bool:
        """Whether the mission may have changed, and was not read back yet."""
        return self._suspected_at is not None or self._reading is not None

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle a message of the vehicle, to the broker or to other systems."""
        kind = message.get_type()
        self._was_left |= self._vehicle.mode_role is not ModeRole.MISSION
        uploader = foreign_uploader(message, self._vehicle)
        if uploader is not None:
            self._uploader, self._suspected_at = uploader, now
        elif kind == "MISSION_CURRENT":
            self._see_current(message, now)
        elif kind == "STATUSTEXT" and means(message.text, TextMeaning.MISSION_UPLOADED):
            self._suspected_at = now
        if self._reading is None:
            return []
        return [*self._reading.receive(message, now), *self._settle(now)]

    def tick(self, now: float) -> list[Message]:
        """Read the mission back when it may have changed."""
        if self._reading is not None:
            return [*self._reading.tick(now), *self._settle(now)]
        is_due = self._suspected_at is not None and now - self._suspected_at >= QUIET_S
        if not is_due or not self._vehicle.is_reachable(now):
            return []
        self._suspected_at = None
        self._reads += 1
        self._reading = exchanges.recognition(self._plan, self._vehicle)
        return self._reading.start(now)

    def _see_current(self, message: Message, now: float) -> None:
        if self._total is not None or message.total not in NO_TOTALS:  # Else it sends none
            if self._total not in {None, message.total}:
                self._suspected_at = now
            self._total = message.total
        self._see_resumption(message.seq)
        self._highest = max(self._highest, message.seq)
        snapshot = self._vehicle.snapshot
        on_ground = snapshot.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
        flies = self._vehicle.mode_role is ModeRole.MISSION and snapshot.armed and not on_ground
        is_over = message.mission_state == mavlink.MISSION_STATE_COMPLETE
        if message.seq >= self._highest or not flies or is_over:
            self._back_since = None
        elif self._back_since is None:
            self._back_since, self._back_at = now, message.seq
        elif now - self._back_since >= BACK_FOR_S and not self._is_back_reported:
            self._is_back_reported = True
            self._suspected_at = now - QUIET_S

    def _see_resumption(self, seq: int) -> None:
        """Follow a vehicle that begins again at the place before the farthest item."""
        if self._vehicle.mode_role is not ModeRole.MISSION:
            return
        if seq > self._highest:
            self._was_left = False
        elif self._was_left and seq == self._place_before:
            self._was_left, self._highest = False, seq

    @property
    def _place_before(self) -> int | None:
        """The item at which a vehicle that repeats its pictures resumes; None: where it was."""
        before = range(self._plan.first_item, min(self._highest, len(self._plan.items)))
        items = self._plan.items
        shoots = any(items[seq].command == mavlink.MAV_CMD_IMAGE_START_CAPTURE for seq in before)
        if not self._vehicle.family.repeats_pictures or not shoots:
            return None
        return max((seq for seq in before if items[seq].is_positional), default=None)

    def _settle(self, now: float) -> list[Message]:
        """Judge what was read."""
        match self._reading.outcome if self._reading else None:
            case Verified():
                self._reading, self._reads = None, 0
                if self._back_since is not None:
                    self.note = f"somebody else set the vehicle back to item {self._back_at}"
                    self._highest = self._back_at
            case Different(count=None):
                self._reading = None
                self._suspected_at = now if self._reads < READS else None
            case Different(reason, int(count)):
                self._reading = None
                who = "somebody else" if self._uploader is None else f"system {self._uploader}"
                self.holds_another = count > self._plan.first_item
                self.loss_reason = (
                    f"{who} put another mission onto the vehicle: {reason}"
                    if self.holds_another
                    else f"{who} {CLEARED}"
                )
        return []


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
        """Handle a message of the vehicle."""
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
        """Count the current item as flown."""
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
