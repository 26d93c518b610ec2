"""Missions that an abort has ended before the edge server has answered their acceptance.

Until that answer is there it may hand such a mission out again to a restarted broker. The abort is
done only then: until then it is handed out again with the mission, and is noted in the journal.
"""

from collections import deque
from collections.abc import Sequence
from typing import Final

from mavlink_broker.edge.wire import AcceptanceResult, EventWork
from mavlink_broker.effects import Acknowledgement, EdgeMessage, Effects
from mavlink_broker.mission.mission_executor import MissionExecutor
from mavlink_broker.mission.phases.aborting import REASONS, abort_note
from mavlink_broker.vehicle.vehicle import Vehicle

ANSWERED_KEPT: Final = 256
"""Work ids of which a second final answer is recognised."""


class UnconfirmedMissions:
    """Missions that an abort ended before their acceptance was answered.

    Each piece of work has one final answer, and this class decides when it may be sent.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._dropped: dict[int, tuple[MissionExecutor, str]] = {}  # By work id, and why
        self._missions_of: dict[int, set[int]] = {}  # Missions by the work id of the abort
        self._held: list[Acknowledgement] = []
        self._answered: deque[int] = deque(maxlen=ANSWERED_KEPT)

    @property
    def are_open(self) -> bool:
        """Whether one of them may still be handed out again; no other mission begins before."""
        return bool(self._dropped)

    def drop(self, mission: MissionExecutor, work: EventWork) -> None:
        """Finish a mission that is reported as aborted once its acceptance is confirmed.

        An abort empties the edge server's queue too: a mission whose acceptance it refuses was
        ended there, and has its report.
        """
        reason = REASONS[work.event.event_type_id]
        self._dropped[mission.work.work_id] = mission, reason

    def hold_answer(self, work: EventWork) -> None:
        """Hold the answer to an abort back for all of them."""
        if self._dropped:
            self._missions_of[work.work_id] = set(self._dropped)
            note = abort_note(work.event, work.work_id, self._vehicle)
            self._vehicle.recovery.hold_abort(note)

    def take_acceptance_result(self, result: AcceptanceResult, effects: Effects) -> bool:
        """Handle the answer to an acceptance; whether it was that of one of them."""
        if result.work_id not in self._dropped:
            return False
        mission, reason = self._dropped.pop(result.work_id)
        if result.is_confirmed or result.has_failed:
            mission.abort(reason, effects)
        for missions in self._missions_of.values():
            missions.discard(result.work_id)
        self._missions_of = {
            abort: missions for abort, missions in self._missions_of.items() if missions
        }
        if not self._dropped:
            self._vehicle.recovery.release_abort()
        return True

    def reopen(self, work_id: int) -> None:
        """Queue new work; an edge server with a fresh database gives the same numbers again."""
        if work_id in self._answered:
            self._answered.remove(work_id)

    def due(self, messages: Sequence[EdgeMessage]) -> list[EdgeMessage]:
        """Give what may be sent by now; what was held back before comes behind the rest.

        The first final answer counts: whatever ends work behind an error answers it once more.
        """
        if not messages and not self._held:
            return []
        due: list[EdgeMessage] = []
        for message in messages:
            if not isinstance(message, Acknowledgement) or message.status == "accepted":
                due.append(message)
            elif message.work_id not in self._answered:
                self._answered.append(message.work_id)
                (self._held if message.work_id in self._missions_of else due).append(message)
        due += [answer for answer in self._held if answer.work_id not in self._missions_of]
        self._held = [answer for answer in self._held if answer.work_id in self._missions_of]
        return due
