"""An event that has come upon a mission, and what becomes of it."""

from dataclasses import dataclass, field

from afarcloud.enumerations import EventType
from afarcloud.plan import Event
from mavlink_broker.edge.work import EventWork
from mavlink_broker.effects import Acknowledgement, Effects
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import Accepted, Refused
from mavlink_broker.microservices.command_sequence import CommandSequence
from mavlink_broker.planning.geofence_check import AreaCheck
from mavlink_broker.planning.live_actions import speed_order
from mavlink_broker.planning.mission import FlightPlan
from mavlink_broker.planning.situation import Spot
from mavlink_broker.vehicle.vehicle import Vehicle

PATIENCE_S = 30.0
"""How long a soft abort lets the running command go on, by the vehicle's time."""
REPLACED = "a later event replaced it"
"""Answer to an abort behind which a newer one decides where the vehicle goes."""
ENDED = "the mission has ended"
CIRCLE = mavlink.MAV_CMD_NAV_LOITER_TURNS
REASONS = {
    EventType.ABORT_MISSION: "aborted by an event",
    EventType.SOFT_ABORT_MISSION: "aborted softly by an event",
}


def within_fence(
    event: Event, area: AreaCheck | None, vehicle: Vehicle
) -> tuple[Event, str | None]:
    """Leave out a place that the plan's geofence forbids, and say what comes instead.

    An emergency is not refused for it: the vehicle lands where it is, or returns.
    """
    point, here = event.abort, vehicle.snapshot.position
    if area is None or point is None:
        return event, None
    start = None if here is None else (here.latitude_deg, here.longitude_deg)
    fault = area.fault_of_order(start, Spot(point.latitude, point.longitude, point.altitude))
    if fault is None:
        return event, None
    is_soft = event.event_type_id is EventType.SOFT_ABORT_MISSION
    instead = "it returns and lands" if is_soft else "it lands where it is"
    return event.model_copy(update={"abort": None}), f"abort: {fault}: {instead}"


@dataclass(slots=True)
class SoftAbort:
    """Waits for the running command to end."""

    work: EventWork
    command: int | None  # Running when it came; None: there is nothing to wait for
    deadline_s: float
    since: float  # [s] When it was accepted, on the broker's clock

    def is_due(self, *, command_ended: bool, now_s: float) -> bool:
        """Whether the mission ends now."""
        return self.command is None or command_ended or now_s >= self.deadline_s


@dataclass(slots=True)
class SpeedOrders:
    """New speeds on their way to a vehicle; a later one replaces an earlier one."""

    vehicle: Vehicle
    _running: tuple[EventWork | None, CommandSequence] | None = field(default=None)
    _may_refuse: bool = False
    has_changed: bool = False  # Or may have, in an earlier run of the broker
    _is_just_told: bool = False
    _held_behind: tuple[int, int] | None = None  # The stretch, and the last item that told one

    def give(
        self, work: EventWork, speed_m_s: float, now: float, effects: Effects, *, is_live: bool
    ) -> None:
        """Tell the vehicle.

        One that flies a live command may refuse: an orbit has its own speed, and everything behind
        it is flown at the new one anyway.
        """
        self._may_refuse = is_live
        if self._running is not None and self._running[0] is not None:
            reason = "a later event gives another speed"
            effects.for_edge.append(Acknowledgement(self._running[0].work_id, "refused", reason))
        self._order(work, speed_m_s, now, effects)

    def hold(self, plan: FlightPlan, speed_m_s: float, now: float, effects: Effects) -> None:
        """Tell a speed that came in flight again behind items that tell the one of the upload."""
        mission = self.vehicle.snapshot.mission
        if mission is None:
            return
        flown = [seq for seq in _mission_speeds(plan) if seq < mission.seq]
        place = (plan.first_command, flown[-1]) if flown else None
        if self._is_just_told:  # Behind all that has been flown
            self._is_just_told, self._held_behind = False, place
        if self._running is not None:
            return
        if place is not None and place != self._held_behind:
            self._held_behind = place
            if self.has_changed:
                self.tell(speed_m_s, now, effects)

    def tell(self, speed_m_s: float, now: float, effects: Effects) -> None:
        """Tell the vehicle a speed of which no event waits to be done."""
        self._order(None, speed_m_s, now, effects)

    def give_up(self, reason: str, effects: Effects) -> None:
        """Order no speed any more; an event that waits to be done is refused."""
        work = None if self._running is None else self._running[0]
        self._running = None
        if work is not None:
            effects.for_edge.append(Acknowledgement(work.work_id, "refused", reason))

    def _order(
        self, work: EventWork | None, speed_m_s: float, now: float, effects: Effects
    ) -> None:
        ways = ((speed_order(speed_m_s),),)
        sequence = CommandSequence(ways, self.vehicle.route, self.vehicle.round_trip)
        self.has_changed = self._is_just_told = True
        self._running = work, sequence
        effects.messages += sequence.start(now)

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Take the answer."""
        if self._running is not None:
            effects.messages += self._running[1].receive(message, now)
            self._settle(effects)

    def tick(self, now: float, effects: Effects) -> None:
        """Repeat what is overdue."""
        if self._running is not None:
            effects.messages += self._running[1].tick(now)
            self._settle(effects)

    def _settle(self, effects: Effects) -> None:
        if self._running is None:
            return
        work, sequence = self._running
        match sequence.outcome:
            case Accepted() | Refused() if work is None:
                pass
            case Accepted() if work is not None:
                effects.for_edge.append(Acknowledgement(work.work_id, "done"))
            case Refused(reason) if work is not None and self._may_refuse:
                later = f"from the next command on: {reason}"
                effects.for_edge.append(Acknowledgement(work.work_id, "done", later))
            case Refused(reason) if work is not None:
                effects.for_edge.append(Acknowledgement(work.work_id, "refused", reason))
            case _:
                return
        self._running = None


def _mission_speeds(plan: FlightPlan) -> list[int]:
    """Find the items that tell the speed of the mission, not that of a circle behind them."""
    found, told = [], []
    for seq, item in enumerate(plan.items):
        if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            told.append(seq)
        elif item.command <= mavlink.MAV_CMD_NAV_LAST:
            found += told[:-1] if item.command == CIRCLE else told
            told = []
    return found
