"""Checks of plans in parts: requests of uploads, and the stored mission."""

import pytest

from tests.support.toy_vehicle import item, takeoff, waypoint
from uav_firmware.bus import Queue
from uav_firmware.modules.navigator.mission.review import BUDGET, MissionReview, PlanChecks
from uav_firmware.msg.mission import (
    MissionItem,
    MissionRejection,
    PlanCheckRequest,
    PlanCheckResult,
    PlanReview,
    PlanType,
)

MISSION = (takeoff(), waypoint(1, 10.0, 0.0))
REJECTION = MissionRejection(1, 5, "beyond the geofence")


class Checks:
    """PlanChecks on queues; each item takes a whole budget, heights below ground are refused."""

    def __init__(self) -> None:
        self.requests: Queue[PlanCheckRequest] = Queue()
        self.results: Queue[PlanCheckResult] = Queue()
        self.checks = PlanChecks(self.requests, self.results, self._review)
        self.checked: list[tuple[PlanType, int]] = []

    def ask(self, request_id: int, *items: MissionItem, kind: PlanType = PlanType.MISSION) -> None:
        self.requests.publish(PlanCheckRequest(request_id, kind, items))

    def run(self, calls: int) -> list[PlanCheckResult]:
        for _ in range(calls):
            self.checks.update()
        return self.results.drain()

    def _review(self, plan_type: PlanType, items: tuple[MissionItem, ...]) -> PlanReview:
        for each in items:
            self.checked.append((plan_type, each.seq))
            yield BUDGET
        return REJECTION if any(each.z < 0.0 for each in items) else None


@pytest.fixture
def checks() -> Checks:
    return Checks()


def test_a_long_plan_takes_several_calls_and_has_one_result(checks: Checks) -> None:
    checks.ask(7, *MISSION)
    assert checks.run(2) == []
    assert checks.run(5) == [PlanCheckResult(7, PlanType.MISSION, None)]


def test_a_rejection_is_the_result(checks: Checks) -> None:
    checks.ask(7, takeoff(), waypoint(1, 10.0, 0.0, height=-1.0))
    assert checks.run(5) == [PlanCheckResult(7, PlanType.MISSION, REJECTION)]


def test_a_newer_request_of_the_same_type_replaces_the_former(checks: Checks) -> None:
    checks.ask(7, *MISSION)
    checks.run(1)
    checks.ask(8, *MISSION)
    assert [result.request_id for result in checks.run(10)] == [8]


def test_plans_of_different_types_are_checked_side_by_side(checks: Checks) -> None:
    checks.ask(7, *MISSION)
    checks.ask(8, item(0, 5100), kind=PlanType.RALLY_POINTS)
    assert [result.request_id for result in checks.run(10)] == [8, 7]


def test_a_geofence_is_accepted_before_the_plans_that_arrive_with_it_are_checked(
    checks: Checks,
) -> None:
    checks.ask(7, *MISSION)
    checks.ask(8, item(0, 5000), kind=PlanType.FENCE)
    assert [result.request_id for result in checks.run(2)] == [8]
    assert {kind for kind, _ in checks.checked} == {PlanType.FENCE}
    assert [result.request_id for result in checks.run(10)] == [7]


class Reviews:
    """How often a stored mission is reviewed."""

    def __init__(self, rejection: MissionRejection | None = None) -> None:
        self.review = MissionReview()
        self.rejection = rejection
        self.count = 0

    def update(self, items: tuple[MissionItem, ...], conditions: int) -> str:
        return self.review.update(items, conditions, lambda _items: self._steps())

    def _steps(self) -> PlanReview:
        self.count += 1
        yield 1
        return self.rejection


def test_a_stored_mission_is_reviewed_once_until_a_condition_changes() -> None:
    reviews = Reviews(REJECTION)
    assert [reviews.update(MISSION, 1) for _ in range(3)] == [REJECTION.reason, "", ""]
    assert reviews.count == 1
    assert reviews.update(MISSION, 2) == ""  # The same reason as before
    assert (reviews.count, reviews.review.rejection) == (2, REJECTION)


def test_an_accepted_upload_is_not_reviewed_again_when_it_is_stored() -> None:
    reviews = Reviews()
    reviews.review.note_accepted(MISSION, 1)
    reviews.update(MISSION, 1)
    assert reviews.count == 0
    reviews.update(MISSION, 2)
    assert reviews.count == 1


def test_an_accepted_upload_that_is_not_stored_leaves_the_rejection_in_force() -> None:
    reviews = Reviews(REJECTION)
    reviews.update(MISSION, 1)
    reviews.review.note_accepted((takeoff(),), 1)
    assert reviews.update(MISSION, 1) == ""
    assert reviews.review.rejection == REJECTION
