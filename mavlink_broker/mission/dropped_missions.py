"""Missions that an abort ends before their acceptance is answered, and the answers behind them.

Until the edge server has answered the acceptance of a mission, it may hand that mission out again
to a restarted broker. So an abort that has ended such a mission is done only when that answer is
there: till then the abort is handed out again with the mission, and is noted in the journal.
"""

from collections import deque
from collections.abc import Sequence
from typing import Final

from mavlink_broker.edge.work import EventWork, Verdict
from mavlink_broker.effects import Acknowledgement, Effects, ForEdge
from mavlink_broker.mission.abort_executor import abort_note
from mavlink_broker.mission.event_execution import REASONS
from mavlink_broker.mission.flight import Flight
from mavlink_broker.vehicle.vehicle import Vehicle

ANSWERED_KEPT: Final = 256
"""Work ids of which a second final answer is recognised."""


class DroppedMissions:
    """Those of one vehicle; sees to it that its work has one final answer each, and when."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._dropped: dict[int, tuple[Flight, str]] = {}  # By work id, and why
        self._owed: dict[int, set[int]] = {}  # Missions by the work id of the abort
        self._held: list[Acknowledgement] = []
        self._answered: deque[int] = deque(maxlen=ANSWERED_KEPT)

    @property
    def are_open(self) -> bool:
        """Whether one of them may still be handed out again; no other mission begins before."""
        return bool(self._dropped)

    def drop(self, flight: Flight, work: EventWork) -> None:
        """Take a mission that is reported as aborted once the edge server agrees that it is ours.

        An abort empties the edge server's queue too: whose acceptance it refuses has been ended
        there, and has its report.
        """
        reason = REASONS[work.event.event_type_id]
        self._dropped[flight.work.work_id] = flight, reason

    def owe(self, work: EventWork) -> None:
        """Hold the answer to an abort back for all of them."""
        if self._dropped:
            self._owed[work.work_id] = set(self._dropped)
            self._vehicle.owed_abort = abort_note(work.event, work.work_id, self._vehicle)

    def take_verdict(self, verdict: Verdict, effects: Effects) -> bool:
        """Learn what became of an acceptance; whether it was that of one of them."""
        if verdict.work_id not in self._dropped:
            return False
        flight, reason = self._dropped.pop(verdict.work_id)
        if verdict.holds:
            flight.abort(reason, effects)
        for missions in self._owed.values():
            missions.discard(verdict.work_id)
        self._owed = {abort: missions for abort, missions in self._owed.items() if missions}
        if not self._dropped:
            self._vehicle.owed_abort = None
        return True

    def open(self, work_id: int) -> None:
        """Take new work; an edge server that begins anew gives the same numbers again."""
        if work_id in self._answered:
            self._answered.remove(work_id)

    def sift(self, messages: Sequence[ForEdge]) -> list[ForEdge]:
        """Give what may be sent by now; what was held back before comes behind the rest.

        The first final answer counts: whatever ends work behind an error answers it once more.
        """
        due: list[ForEdge] = []
        for message in messages:
            if not isinstance(message, Acknowledgement) or message.status == "accepted":
                due.append(message)
            elif message.work_id not in self._answered:
                self._answered.append(message.work_id)
                (self._held if message.work_id in self._owed else due).append(message)
        due += [answer for answer in self._held if answer.work_id not in self._owed]
        self._held = [answer for answer in self._held if answer.work_id in self._owed]
        return due
