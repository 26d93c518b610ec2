"""Checks of plans: the rules on items here, the plan as a whole by the navigator on the bus."""

import pytest

from tests.support.toy_vehicle import HOME, item, takeoff, waypoint
from uav_firmware.bus import Queue
from uav_firmware.lib.stepwise import Stepwise
from uav_firmware.modules.mavlink.missions.plan_checks import PlanChecker
from uav_firmware.modules.navigator.params import NavigatorParams
from uav_firmware.msg.mission import (
    MissionItem,
    MissionRejection,
    MissionResult,
    PlanCheckRequest,
    PlanCheckResult,
    PlanType,
)
from uav_firmware.msg.status import HomePosition
from uav_firmware.parameters import Registry

FAR = waypoint(0, 20_000.0, 0.0)
MISSION = (takeoff(), waypoint(1, 10.0, 0.0))


class Checker:
    """A PlanChecker and both of its queues."""

    def __init__(self, *, limits: bool = True) -> None:
        self.requests: Queue[PlanCheckRequest] = Queue()
        self.results: Queue[PlanCheckResult] = Queue()
        self.home: HomePosition | None = None
        registry = Registry()
        if limits:
            registry.add(NavigatorParams)
        self.checker = PlanChecker(
            self.requests, self.results, home=lambda: self.home, registry=registry
        )

    def answer(self, rejection: MissionRejection | None) -> int:
        """Answer the one request; gives its id."""
        (request,) = self.requests.drain()
        self.results.publish(PlanCheckResult(request.request_id, request.plan_type, rejection))
        assert self.checker.receive()
        return request.request_id


@pytest.mark.parametrize(
    ("plan_type", "good", "bad"),
    [
        (PlanType.MISSION, takeoff(), item(0, 5000)),
        (PlanType.FENCE, item(0, 5000, frame=3), takeoff()),
        (PlanType.RALLY_POINTS, item(0, 5100, frame=3), takeoff()),
    ],
)
def test_each_type_has_rules_of_its_own(
    plan_type: PlanType, good: MissionItem, bad: MissionItem
) -> None:
    check = Checker().checker.check_of(plan_type)
    assert check.item(good) is None
    rejection = check.item(bad)
    assert rejection is not None
    assert rejection.result == MissionResult.UNSUPPORTED
    assert check.stored([good]) is None
    assert check.stored([bad]) is not None


def test_an_item_is_checked_against_the_present_home() -> None:
    checker = Checker()
    check = checker.checker.check_of(PlanType.MISSION)
    assert check.item(FAR) is None
    checker.home = HomePosition(0, *HOME, (0.0, 0.0, 0.0), 0.0)
    assert check.item(FAR) is not None


@pytest.mark.parametrize("limits", [True, False])
def test_a_stored_mission_is_checked_by_the_parameters_if_they_are_declared(
    limits: bool,  # a parameter of the test
) -> None:
    check = Checker(limits=limits).checker.check_of(PlanType.MISSION)
    rejection = check.stored([waypoint(0, 0.0, 0.0), waypoint(1, 2000.0, 0.0)])
    assert (rejection is not None) is limits


def test_a_plan_waits_for_the_answer_of_the_navigator() -> None:
    checker = Checker()
    check = Stepwise(checker.checker.check_of(PlanType.MISSION).plan(MISSION))
    assert not check.advance(1)
    assert not check.advance(1)
    rejection = MissionRejection(1, 5, "lies outside the geofence")
    checker.answer(rejection)
    assert check.advance(1)
    assert check.result == rejection


def test_the_answer_to_a_cancelled_check_is_not_taken_for_the_next_one() -> None:
    checker = Checker()
    check = checker.checker.check_of(PlanType.MISSION)
    Stepwise(check.plan(MISSION)).advance(1)
    first = checker.answer(MissionRejection(1, 5, "too late"))
    second = Stepwise(check.plan(MISSION))
    assert not second.advance(1)
    assert checker.answer(None) > first
    assert second.advance(1)
    assert second.result is None


def test_without_an_answer_there_is_nothing_to_resume() -> None:
    assert not Checker().checker.receive()
