"""A plan that takes long to judge, and copies of messages that come late."""

from collections.abc import Sequence
from typing import Any

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import (
    BROKER,
    GROUND,
    SYSTEM,
    Bench,
    mission_count,
    mission_item,
)
from uav_firmware.modules.mavlink.missions.mission_store import PlanCheck
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.modules.mavlink.wire.dispatcher import PlanChecks
from uav_firmware.msg.mission import MissionItem, MissionRejection, PlanReview

ACCEPTED, INVALID, DENIED, CANCELLED = 0, 5, 14, 15
LABOUR = 1000  # Of one item: each takes several ticks
CLEAR = mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 0)


class SlowJudge:
    """Takes its time over every item; refuses a plan of a height below ground."""

    def __init__(self) -> None:
        self.judged = 0

    def checks(self) -> PlanChecks:
        check = PlanCheck(lambda _: None, self._review)
        return PlanChecks(check, check, check)

    def _review(self, items: Sequence[MissionItem]) -> PlanReview:
        for item in items:
            self.judged += 1
            if item.z < 0.0:
                return MissionRejection(item.seq, INVALID, "is below ground")
            yield LABOUR
        return None


@pytest.fixture
def judge() -> SlowJudge:
    return SlowJudge()


@pytest.fixture
def bench(judge: SlowJudge) -> Bench:
    return Bench(checks=judge.checks())


def send_all(bench: Bench, count: int, **fields: Any) -> None:
    """Upload a plan, all but the answer."""
    bench.run()
    bench.hear()
    bench.say(mission_count(count))
    for seq in range(count):
        bench.say(mission_item(seq, **fields))
    bench.run()


def results(bench: Bench, at: Any = GROUND) -> list[int]:
    return [message.type for message in bench.hear("MISSION_ACK", at=at)]


def held(bench: Bench) -> int:
    mission = bench.topics.mission.value
    assert mission is not None
    return len(mission.items)


def test_judging_is_spread_over_ticks_and_then_answered_once(
    bench: Bench, judge: SlowJudge
) -> None:
    send_all(bench, 10)
    assert 0 < judge.judged < 10
    assert results(bench) == []
    assert held(bench) == 0
    bench.run(1_000_000)
    assert results(bench) == [ACCEPTED]
    assert held(bench) == 10


def test_a_plan_found_bad_late_is_refused_whole(bench: Bench) -> None:
    send_all(bench, 10, z=-1.0)
    bench.run(1_000_000)
    assert results(bench) == [INVALID]
    assert held(bench) == 0


def test_the_last_item_again_while_it_is_judged_changes_nothing(bench: Bench) -> None:
    send_all(bench, 10)
    bench.hear()
    for _ in range(3):
        bench.say(mission_item(9))
        bench.run()
    assert bench.hear("MISSION_REQUEST_INT") == []
    bench.run(1_000_000)
    assert results(bench) == [ACCEPTED]


def test_nobody_else_gets_in_while_a_plan_is_judged(bench: Bench) -> None:
    send_all(bench, 10)
    bench.say(mission_count(3), source=BROKER, system=99)
    bench.say(CLEAR, source=BROKER, system=99)
    bench.run()
    assert results(bench, at=BROKER) == [DENIED, DENIED]
    bench.run(1_000_000)
    assert results(bench) == [ACCEPTED]


@pytest.mark.parametrize(
    "ending",
    [mavlink.MAVLink_mission_ack_message(SYSTEM, 1, CANCELLED, 0), mission_count(3), CLEAR],
    ids=["cancelled", "begun anew", "cleared"],
)
def test_the_uploader_may_think_better_of_it_while_its_plan_is_judged(
    bench: Bench, ending: Any
) -> None:
    send_all(bench, 10)
    bench.say(ending)
    bench.run(1_000_000)
    assert held(bench) == 0
    send_all(bench, 4)
    bench.run(1_000_000)
    assert held(bench) == 4


def said(bench: Bench, message: Any) -> tuple[bytes, Any]:
    """Say something; gives the datagram."""
    bench.say(message)
    return bench.memory.incoming[-1]


def come_again(bench: Bench, copy: tuple[bytes, Any]) -> None:
    bench.memory.incoming.append(copy)
    bench.run()


def test_a_late_copy_of_a_count_opens_no_second_transfer() -> None:
    bench = Bench()
    count = said(bench, mission_count(1))
    bench.say(mission_item(0))
    bench.run()
    assert results(bench) == [ACCEPTED]
    come_again(bench, count)
    assert bench.hear("MISSION_REQUEST_INT")[1:] == []
    bench.run(20_000_000)
    assert results(bench) == []
    assert bench.hear("STATUSTEXT") == []


def test_the_same_plan_again_is_no_copy() -> None:
    bench = Bench()
    for _ in range(2):
        send_all(bench, 1)
        assert results(bench) == [ACCEPTED]
    assert bench.topics.mission.count == 3


def test_a_late_copy_of_a_removal_does_not_remove_the_next_plan() -> None:
    bench = Bench()
    send_all(bench, 2)
    removal = said(bench, CLEAR)
    bench.run()
    send_all(bench, 3)
    bench.hear()
    come_again(bench, removal)
    assert held(bench) == 3
    (answer,) = bench.ask(CLEAR, "MISSION_ACK")
    assert answer.type == ACCEPTED
    assert held(bench) == 0


def test_all_plans_are_removed_or_none() -> None:
    bench = Bench()
    send_all(bench, 2)
    bench.say(mission_count(5, 1), source=BROKER, system=99)
    bench.run()
    everything = mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 255)
    (answer,) = bench.ask(everything, "MISSION_ACK")
    assert (answer.type, answer.mission_type) == (DENIED, 255)
    assert held(bench) == 2
    bench.say(
        mavlink.MAVLink_mission_ack_message(SYSTEM, 1, CANCELLED, 1), source=BROKER, system=99
    )
    (answer,) = bench.ask(everything, "MISSION_ACK")
    assert (answer.type, answer.mission_type) == (ACCEPTED, 255)
    assert held(bench) == 0
