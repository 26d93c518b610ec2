"""Checks of uploaded plans: items by rules here, the complete plan by the navigator.

The navigator has the geofence in local coordinates and the position of the vehicle; its check is
requested over the bus. A stored plan is checked here by all rules, because at boot neither home nor
position is known.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import count
from typing import Final, NamedTuple

from uav_firmware.bus import Queue
from uav_firmware.lib import fence_rules, mission_rules
from uav_firmware.lib.mission_rules import DistanceLimits
from uav_firmware.modules.mavlink.missions.mission_store import UNTIL_NEXT_CALL, PlanCheck
from uav_firmware.msg.mission import (
    MissionItem,
    MissionRejection,
    PlanCheckRequest,
    PlanCheckResult,
    PlanReview,
    PlanType,
)
from uav_firmware.msg.status import HomePosition
from uav_firmware.parameters import Registry

_LIMITS: Final = ("MIS_DIST_1WP", "MIS_DIST_WPS")


class PlanRules(NamedTuple):
    """Rules of one type of plan that need no position of the vehicle."""

    item: Callable[[MissionItem, HomePosition | None], MissionRejection | None]
    plan: Callable[[Sequence[MissionItem], DistanceLimits], MissionRejection | None]


RULES: Final[Mapping[PlanType, PlanRules]] = {
    PlanType.MISSION: PlanRules(
        mission_rules.check_item, lambda items, limits: mission_rules.check(items, None, limits)
    ),
    PlanType.FENCE: PlanRules(
        lambda item, _home: fence_rules.check_fence_item(item),
        lambda items, _limits: fence_rules.check_fence(items),
    ),
    PlanType.RALLY_POINTS: PlanRules(
        lambda item, _home: fence_rules.check_rally_point(item),
        lambda items, _limits: fence_rules.check_rally_points(items),
    ),
}


class PlanChecker:
    """Checks plans: requests the check of the navigator and receives the result."""

    def __init__(
        self,
        requests: Queue[PlanCheckRequest],
        results: Queue[PlanCheckResult],
        *,
        home: Callable[[], HomePosition | None],
        registry: Registry,
        rules: Mapping[PlanType, PlanRules] = RULES,
    ) -> None:
        self._requests = requests
        self._results = results
        self._home = home
        self._registry = registry
        self._rules = rules
        self._request_ids = count(1)
        self._received: dict[PlanType, PlanCheckResult] = {}

    def receive(self) -> bool:
        """Apply the results of the navigator; return whether there was one."""
        results = self._results.drain()
        for result in results:
            self._received[result.plan_type] = result
        return bool(results)

    def check_of(self, plan_type: PlanType) -> PlanCheck:
        """The checks of one type of plan."""
        rules = self._rules[plan_type]
        return PlanCheck(
            item=lambda item: rules.item(item, self._home()),
            plan=lambda items: self._request_check(plan_type, items),
            stored=lambda items: rules.plan(items, self._limits()),
        )

    def _request_check(self, plan_type: PlanType, items: tuple[MissionItem, ...]) -> PlanReview:
        request_id = next(self._request_ids)
        self._requests.publish(PlanCheckRequest(request_id, plan_type, items))
        while True:
            result = self._received.get(plan_type)
            if result is not None and result.request_id == request_id:
                return result.rejection
            yield UNTIL_NEXT_CALL

    def _limits(self) -> DistanceLimits:
        declared = self._registry.names()
        return DistanceLimits(
            *(float(self._registry.get(name)) if name in declared else 0.0 for name in _LIMITS)
        )
