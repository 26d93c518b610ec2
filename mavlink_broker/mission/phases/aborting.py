"""ABORTING: an event or an alarm has ended the mission, and the vehicle is sent where that says."""

from typing import Final

from afarcloud.plan import Event as AbortEvent
from mavlink_broker.effects import Acknowledgement, Effects
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.mission.abort_executor import (
    LATE_ORDER_S,
    AbortExecutor,
    abort_note,
    within_fence,
)
from mavlink_broker.mission.context import MissionContext
from mavlink_broker.mission.phases.phase import Phase, Result
from mavlink_broker.mission.states import Event
from mavlink_broker.recovery.record import PendingReturn
from mavlink_broker.vehicle.alarms import mission_error
from mavlink_broker.vehicle.control_authority import Authority

RESTARTED: Final = "the vehicle was restarted"
RETURN_ENDED: Final = f"{RESTARTED} on its way home"


class Aborting(Phase):
    """One abort after the other; the newest one decides."""

    def __init__(self, context: MissionContext) -> None:
        self._mission = context
        self._vehicle = context.vehicle
        self._executor: AbortExecutor | None = None
        self._note: str | None = None  # What is done otherwise than the event says
        self._work_id: int | None = None  # Of the event; None: an alarm has ended the mission

    def order(self, event: AbortEvent, work_id: int | None, now: float) -> None:
        """Set what the vehicle is to do; the transition to this phase begins it.

        `work_id` is None where an alarm has ended the mission.
        """
        mission, vehicle = self._mission, self._vehicle
        vehicle.forget_foreign_order()
        event, self._note = within_fence(event, mission.area, vehicle)
        arms_until = now + LATE_ORDER_S if mission.authority.is_arming_ordered else None
        self._executor = AbortExecutor(event, vehicle, was_ours=True, arms_until=arms_until)
        self._work_id = work_id
        if work_id is not None:
            vehicle.recovery.note_abort(abort_note(event, work_id, vehicle))
            return
        vehicle.recovery.clear_abort()
        vehicle.recovery.note_return(
            PendingReturn(
                mission=mission.work.name,
                reason=mission.ledger.message or "",
                noted_s=vehicle.snapshot.time_s,
            )
        )

    def enter(self, now: float, effects: Effects) -> Result:
        """Give the first order."""
        if self._executor is not None:
            effects.messages += self._executor.start(now)
        return None

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Handle a message of the vehicle."""
        if self._executor is not None:
            effects.messages += self._executor.receive(message, now)

    def tick(self, now: float, effects: Effects) -> Result:
        """Repeat what is overdue until the vehicle has obeyed."""
        if self._executor is None:
            return None
        effects.messages += self._executor.tick(now)
        if not self._executor.is_over:
            return None
        self.acknowledge(effects)
        return Event.ENDED

    @property
    def leaves_hovering(self) -> bool | None:
        """Whether the vehicle hovers afterwards; None: there was no abort."""
        return None if self._executor is None else self._executor.leaves_hovering

    def who(self, now: float) -> Authority | None:
        """Decide who is in command of the vehicle; None: there was no abort."""
        return None if self._executor is None else self._executor.who(now)

    def acknowledge(self, effects: Effects, instead: str | None = None) -> None:
        """Acknowledge once that an event has been carried out, or what replaces it."""
        if self._executor is not None and self._work_id is not None:
            taken = self._executor.taken
            status = "done" if taken is None else "refused"
            note = taken or instead or self._note
            effects.for_edge.append(Acknowledgement(self._work_id, status, note))
            self._vehicle.recovery.clear_abort()
            self._work_id = None

    def refuse(self, reason: str, effects: Effects) -> None:
        """Refuse an event that cannot be carried out to its end, if there is one."""
        if self._work_id is not None:
            effects.for_edge.append(Acknowledgement(self._work_id, "refused", reason))
            self._vehicle.recovery.clear_abort()
            self._work_id = None

    def drop(self) -> None:
        """Give no further order."""
        self._executor = None

    def vehicle_restarted(self, effects: Effects) -> None:
        """End an abort, or a return that an alarm has ordered: the vehicle was restarted."""
        if self._work_id is None:
            failure = mission_error(RETURN_ENDED)
            mission_id = self._mission.work.mission.mission_id
            effects.for_edge.append(self._mission.reporter.alarm(failure, mission_id))
        self.refuse(RESTARTED, effects)
        self._executor = None
