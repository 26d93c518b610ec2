"""Checks of plans, a part at a time, so that no control step waits for a long one."""

from collections.abc import Callable, Hashable, Sequence
from typing import Final, TypeAlias

from uav_firmware.bus import Queue
from uav_firmware.lib.stepwise import Stepwise
from uav_firmware.msg.mission import (
    MissionItem,
    MissionRejection,
    PlanCheckRequest,
    PlanCheckResult,
    PlanReview,
    PlanType,
)

BUDGET: Final = 200
"""Work of one step, in the unit of PlanReview: some 1 ms."""

_MISSION_ERROR: Final = 1  # MAV_MISSION_RESULT
NOT_CHECKED: Final = MissionRejection(0, _MISSION_ERROR, "internal error: it was not checked")

Items: TypeAlias = Sequence[MissionItem]


class PlanChecks:
    """Answers requests for the check of an upload."""

    def __init__(
        self,
        requests: Queue[PlanCheckRequest],
        results: Queue[PlanCheckResult],
        review: Callable[[PlanType, tuple[MissionItem, ...]], PlanReview],
    ) -> None:
        self._requests = requests
        self._results = results
        self._review = review
        self._work: dict[PlanType, tuple[int, Stepwise[MissionRejection | None]]] = {}

    def update(self) -> None:
        """Check a part of each plan and publish the results that are complete.

        A geofence is checked before the plans that arrive with it, so that it is in force when
        they are checked.
        """
        for request in self._requests.drain():
            review = Stepwise(self._review(request.plan_type, request.items))
            self._work[request.plan_type] = (request.request_id, review)
        if not self._work:
            return
        is_fence_first = PlanType.FENCE in self._work
        for plan_type in (PlanType.FENCE,) if is_fence_first else tuple(self._work):
            request_id, work = self._work[plan_type]
            try:
                is_complete = work.advance(BUDGET)
            except Exception:  # What could not be checked is refused
                del self._work[plan_type]
                self._results.publish(PlanCheckResult(request_id, plan_type, NOT_CHECKED))
                raise
            if is_complete:
                del self._work[plan_type]
                self._results.publish(PlanCheckResult(request_id, plan_type, work.result))


class MissionReview:
    """Whether the stored mission can be flown, kept up to date.

    It is checked again when the conditions (home, geofence, parameters) change; the former
    result stands until the new one is complete.
    """

    def __init__(self) -> None:
        self.rejection: MissionRejection | None = None
        self._items: Items = ()
        self._conditions: Hashable = None
        self._work: Stepwise[MissionRejection | None] | None = None
        self._accepted: tuple[Items, Hashable] = ((), None)

    def note_accepted(self, items: Items, conditions: Hashable) -> None:
        """Note an upload that passed the check, so that it is not checked again when stored."""
        self._accepted = (items, conditions)

    def update(
        self, items: Items, conditions: Hashable, review: Callable[[Items], PlanReview]
    ) -> str:
        """Check a part of what has changed; returns a new reason not to fly, or an empty text."""
        if items is not self._items or conditions != self._conditions:
            self.rejection = self.rejection if items is self._items else None
            self._items, self._conditions = items, conditions
            accepted, under = self._accepted
            is_checked = items is accepted and conditions == under
            self._work = None if is_checked else Stepwise(review(items))
        if self._work is None:
            return ""
        try:
            is_complete = self._work.advance(BUDGET)
        except Exception:  # As in PlanChecks
            self._work, self.rejection = None, NOT_CHECKED
            raise
        if not is_complete:
            return ""
        before, self.rejection = self.rejection, self._work.result
        self._work = None
        if self.rejection is None or self.rejection == before:
            return ""
        return self.rejection.reason
