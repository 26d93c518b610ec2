"""Notices that another system changed the mission that flies, and finds out what it is now.

Vehicles that give ids to their missions show it at once
(`mavlink_broker.mission.progress_monitor`). Of the others only signs are seen: another count of
items, the acknowledgement of somebody's upload, the vehicle's STATUSTEXT, an item number that goes
back. None of them proves anything, so the mission is read back and compared. The same mission with
an earlier item current was set back by another ground station: it flies on, its report notes it.
An earlier run of the broker has reported which items were reached, so a vehicle that was set back
while no broker ran is found too.
"""

from typing import Final

from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.autopilots.status_texts import TextMeaning, means
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.mission_verify import Different, MissionVerify, Verified
from mavlink_broker.mission import exchanges
from mavlink_broker.planning.mission import FlightPlan
from mavlink_broker.vehicle.vehicle import Vehicle

QUIET_S: Final = 1.5
"""After the last frame of a transfer the mission is read back."""
BACK_FOR_S: Final = 1.5
"""How long an earlier item must be current: frames arrive out of order."""
READS: Final = 3
"""How often the mission is read back; a vehicle that does not answer is taken to fly on."""
NO_TOTALS: Final = frozenset({0, 0xFFFF})
_TRANSFER: Final = frozenset({"MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"})


class MissionChangeMonitor:
    """Monitors one segment in flight."""

    def __init__(self, plan: FlightPlan, vehicle: Vehicle, reached: int = -1) -> None:
        """Begin behind the last item that is known to be `reached`; -1: none."""
        self._plan = plan
        self._vehicle = vehicle
        self._total: int | None = None
        self._highest = reached
        self._back_since: float | None = None
        self._back_at = -1
        self._is_back_reported = False
        self._suspected_at: float | None = None
        self._uploader: int | None = None
        self._reads = 0
        self._reading: MissionVerify | None = None
        self.departure: str | None = None
        self.note: str | None = None  # What somebody has changed of a mission that still flies

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle, to the broker or to other systems."""
        kind = message.get_type()
        if kind in _TRANSFER and not self._vehicle.route.is_for_us(message):
            self._see_transfer(message, now)
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

    def _see_transfer(self, message: Message, now: float) -> None:
        is_mission = getattr(message, "mission_type", 0) == mavlink.MAV_MISSION_TYPE_MISSION
        is_end = message.get_type() == "MISSION_ACK"
        if not is_mission or (is_end and message.type != mavlink.MAV_MISSION_ACCEPTED):
            return
        self._uploader = message.target_system
        self._suspected_at = now

    def _see_current(self, message: Message, now: float) -> None:
        if message.total not in NO_TOTALS:
            if self._total not in {None, message.total}:
                self._suspected_at = now
            self._total = message.total
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

    def _settle(self, now: float) -> list[Message]:
        """Judge what was read."""
        match self._reading.outcome if self._reading else None:
            case Verified():
                self._reading, self._reads = None, 0
                if self._back_since is not None:
                    self.note = f"somebody else set the vehicle back to item {self._back_at}"
                    self._highest = self._back_at
            case Different(reason) if reason.startswith("mission could not be read"):
                self._reading = None
                self._suspected_at = now if self._reads < READS else None
            case Different(reason):
                self._reading = None
                who = "somebody else" if self._uploader is None else f"system {self._uploader}"
                self.departure = f"{who} put another mission onto the vehicle: {reason}"
        return []
