"""Changes of speed by events, while a mission flies or is transferred to the vehicle.

The items of a segment set the speed of their upload. So a speed that comes during the transfer is
ordered behind it, and a speed that was changed is ordered again behind each item that sets another.
"""

from typing import Final

from mavlink_broker.edge.work import EventWork
from mavlink_broker.effects import Acknowledgement, Effects
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import Accepted, CommandSequence, Refused
from mavlink_broker.mission.segments import Segments
from mavlink_broker.mission.states import ENDING, IN_FLIGHT, WITH_ITEMS, State
from mavlink_broker.planning.live_actions import speed_command
from mavlink_broker.planning.mission import FlightPlan
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import Authority
from mavlink_broker.vehicle.vehicle import Vehicle

MISSION_ENDED: Final = "the mission has ended"
_CIRCLE: Final[int] = mavlink.MAV_CMD_NAV_LOITER_TURNS


class SpeedChanges:
    """The speed of one mission; a later change replaces an earlier one."""

    def __init__(self, vehicle: Vehicle, segments: Segments) -> None:
        self._vehicle = vehicle
        self._segments = segments
        self._running: tuple[EventWork | None, CommandSequence] | None = None
        self._may_refuse = False
        self._late_speed_m_s: float | None = None  # Came while the items were being transferred
        self._has_changed = False
        self._is_new = False  # It was ordered behind all items so far
        self._repeated_behind: tuple[int, int] | None = None  # Segment, last item with a speed

    def resume(self) -> None:
        """Note that an earlier run of the broker may have changed the speed."""
        self._has_changed = True

    def change(
        self,
        work: EventWork,
        speed_m_s: float,
        state: State,
        who: Authority,
        now: float,
        effects: Effects,
    ) -> None:
        """Fly at another speed [m/s] from now on; items of a transfer stay as they are.

        A vehicle in a live command may refuse: an orbit has its own speed, and everything behind
        it is flown at the new one anyway.
        """
        if state in ENDING:
            effects.for_edge.append(Acknowledgement(work.work_id, "refused", MISSION_ENDED))
            return
        self._late_speed_m_s = speed_m_s if state in WITH_ITEMS else None
        if self._late_speed_m_s is None:
            self._segments.set_speed(speed_m_s)
        if state not in IN_FLIGHT:
            effects.for_edge.append(Acknowledgement(work.work_id, "done"))
        elif who is not Authority.BROKER:
            reason = control_authority.reason(who, self._vehicle.observed_mode)
            effects.for_edge.append(Acknowledgement(work.work_id, "refused", reason))
        else:
            self._may_refuse = state is State.FLYING_LIVE
            if self._running is not None and self._running[0] is not None:
                reason, earlier = "a later event gives another speed", self._running[0].work_id
                effects.for_edge.append(Acknowledgement(earlier, "refused", reason))
            self._order(work, now, effects)

    def order_late(self, state: State, now: float, effects: Effects) -> None:
        """Order the speed that came during a transfer, when that is over."""
        speed_m_s = self._late_speed_m_s
        if speed_m_s is None or state in WITH_ITEMS:
            return
        self._late_speed_m_s = None
        self._segments.set_speed(speed_m_s)
        if state is State.RUNNING:
            self._order(None, now, effects)

    def repeat(self, now: float, effects: Effects) -> None:
        """Order a changed speed again behind items that set the one of the upload."""
        plan, mission = self._segments.plan, self._vehicle.snapshot.mission
        if mission is None:
            return
        flown = [seq for seq in _mission_speeds(plan) if seq < mission.seq]
        place = (plan.first_command, flown[-1]) if flown else None
        if self._is_new:
            self._is_new, self._repeated_behind = False, place
        if self._running is not None:
            return
        if place is not None and place != self._repeated_behind:
            self._repeated_behind = place
            if self._has_changed:
                self._order(None, now, effects)

    def cancel(self, reason: str, effects: Effects) -> None:
        """Order no speed any more; an event that waits is refused."""
        work = None if self._running is None else self._running[0]
        self._running = None
        if work is not None:
            effects.for_edge.append(Acknowledgement(work.work_id, "refused", reason))

    def _order(self, work: EventWork | None, now: float, effects: Effects) -> None:
        alternatives = ((speed_command(self._leg_speed_m_s),),)
        sequence = CommandSequence(alternatives, self._vehicle.route, self._vehicle.round_trip)
        self._has_changed = self._is_new = True
        self._running = work, sequence
        effects.messages += sequence.start(now)

    @property
    def _leg_speed_m_s(self) -> float:
        """Speed of the leg that is flown, as the items would set it now."""
        plan, mission = self._segments.plan, self._vehicle.snapshot.mission
        flown = [] if mission is None else [n for n in _mission_speeds(plan) if n < mission.seq]
        return plan.items[flown[-1]].parameters[1] if flown else self._segments.speed_m_s

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Handle the answer."""
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
    """Find the items that set the speed of the mission, not that of a circle behind them."""
    found: list[int] = []
    speeds: list[int] = []
    for seq, item in enumerate(plan.items):
        if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            speeds.append(seq)
        elif item.command <= mavlink.MAV_CMD_NAV_LAST:
            found += speeds[:-1] if item.command == _CIRCLE else speeds
            speeds = []
    return found
