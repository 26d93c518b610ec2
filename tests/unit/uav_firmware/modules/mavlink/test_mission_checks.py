"""Plans whose check takes several ticks, and duplicated messages."""

from collections.abc import Sequence
from typing import Any

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import (
    BROKER,
    GROUND,
    SYSTEM,
    MavlinkHarness,
    mission_count,
    mission_item,
)
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.mission import MissionItem, MissionRejection, PlanReview

ACCEPTED, INVALID, DENIED, CANCELLED = 0, 5, 14, 15
WORK_PER_ITEM = 1000  # Several ticks each
CLEAR = mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 0)


class SlowCheck:
    """Takes several ticks per item; refuses a plan below ground."""

    def __init__(self) -> None:
        self.checked = 0

    def review(self, items: Sequence[MissionItem]) -> PlanReview:
        for item in items:
            self.checked += 1
            if item.z < 0.0:
                return MissionRejection(item.seq, INVALID, "is below ground")
            yield WORK_PER_ITEM
        return None


@pytest.fixture
def slow_check() -> SlowCheck:
    return SlowCheck()


@pytest.fixture
def harness(slow_check: SlowCheck) -> MavlinkHarness:
    return MavlinkHarness(review=slow_check.review)


def send_all(harness: MavlinkHarness, count: int, **fields: Any) -> None:
    """Upload a plan without waiting for the answer."""
    harness.run()
    harness.received()
    harness.send(mission_count(count))
    for seq in range(count):
        harness.send(mission_item(seq, **fields))
    harness.run()


def results(harness: MavlinkHarness, at: Any = GROUND) -> list[int]:
    return [message.type for message in harness.received("MISSION_ACK", at=at)]


def held(harness: MavlinkHarness) -> int:
    mission = harness.topics.mission.value
    assert mission is not None
    return len(mission.items)


def test_the_check_is_spread_over_ticks_and_answered_once(
    harness: MavlinkHarness, slow_check: SlowCheck
) -> None:
    send_all(harness, 10)
    assert 0 < slow_check.checked < 10
    assert results(harness) == []
    assert held(harness) == 0
    harness.run(1_000_000)
    assert results(harness) == [ACCEPTED]
    assert held(harness) == 10


def test_a_plan_refused_in_a_late_call_is_refused_as_a_whole(harness: MavlinkHarness) -> None:
    send_all(harness, 10, z=-1.0)
    harness.run(1_000_000)
    assert results(harness) == [INVALID]
    assert held(harness) == 0


def test_a_repeated_last_item_during_the_check_is_ignored(harness: MavlinkHarness) -> None:
    send_all(harness, 10)
    harness.received()
    for _ in range(3):
        harness.send(mission_item(9))
        harness.run()
    assert harness.received("MISSION_REQUEST_INT") == []
    harness.run(1_000_000)
    assert results(harness) == [ACCEPTED]


def test_another_uploader_is_denied_while_a_plan_is_checked(harness: MavlinkHarness) -> None:
    send_all(harness, 10)
    harness.send(mission_count(3), source=BROKER, system=99)
    harness.send(CLEAR, source=BROKER, system=99)
    harness.run()
    assert results(harness, at=BROKER) == [DENIED, DENIED]
    harness.run(1_000_000)
    assert results(harness) == [ACCEPTED]


@pytest.mark.parametrize(
    "ending",
    [mavlink.MAVLink_mission_ack_message(SYSTEM, 1, CANCELLED, 0), mission_count(3), CLEAR],
    ids=["cancelled", "restarted", "cleared"],
)
def test_the_uploader_may_restart_or_cancel_during_the_check(
    harness: MavlinkHarness, ending: Any
) -> None:
    send_all(harness, 10)
    harness.send(ending)
    harness.run(1_000_000)
    assert held(harness) == 0
    send_all(harness, 4)
    harness.run(1_000_000)
    assert held(harness) == 4


def texts(harness: MavlinkHarness, message: Any) -> tuple[bytes, Any]:
    """Send a message; return the datagram."""
    harness.send(message)
    return harness.memory.incoming[-1]


def come_again(harness: MavlinkHarness, copy: tuple[bytes, Any]) -> None:
    harness.memory.incoming.append(copy)
    harness.run()


def test_a_duplicated_count_starts_no_second_transfer() -> None:
    harness = MavlinkHarness()
    count = texts(harness, mission_count(1))
    harness.send(mission_item(0))
    harness.run()
    assert results(harness) == [ACCEPTED]
    come_again(harness, count)
    assert harness.received("MISSION_REQUEST_INT")[1:] == []
    harness.run(20_000_000)
    assert results(harness) == []
    assert harness.received("STATUSTEXT") == []


@pytest.mark.parametrize("is_slow", [False, True], ids=["in the same step", "during a long check"])
def test_a_count_duplicated_before_the_answer_starts_no_second_transfer(
    slow_check: SlowCheck,
    is_slow: bool,  # a parameter of the test
) -> None:
    harness = MavlinkHarness(review=slow_check.review if is_slow else None)
    count = texts(harness, mission_count(2))
    for seq in range(2):
        harness.send(mission_item(seq))
    come_again(harness, count)
    harness.run(1_000_000)
    requested = [message.seq for message in harness.received("MISSION_REQUEST_INT")]
    assert (requested, held(harness)) == ([0, 1], 2)


def test_the_same_plan_uploaded_again_is_not_a_duplicate() -> None:
    harness = MavlinkHarness()
    for _ in range(2):
        send_all(harness, 1)
        assert results(harness) == [ACCEPTED]
    assert harness.topics.mission.count == 3


def test_a_duplicated_removal_does_not_remove_the_next_plan() -> None:
    harness = MavlinkHarness()
    send_all(harness, 2)
    removal = texts(harness, CLEAR)
    harness.run()
    send_all(harness, 3)
    harness.received()
    come_again(harness, removal)
    assert held(harness) == 3
    (answer,) = harness.request(CLEAR, "MISSION_ACK")
    assert answer.type == ACCEPTED
    assert held(harness) == 0


def test_all_plans_are_removed_or_none() -> None:
    harness = MavlinkHarness()
    send_all(harness, 2)
    harness.send(mission_count(5, 1), source=BROKER, system=99)
    harness.run()
    everything = mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 255)
    (answer,) = harness.request(everything, "MISSION_ACK")
    assert (answer.type, answer.mission_type) == (DENIED, 255)
    assert held(harness) == 2
    harness.send(
        mavlink.MAVLink_mission_ack_message(SYSTEM, 1, CANCELLED, 1), source=BROKER, system=99
    )
    (answer,) = harness.request(everything, "MISSION_ACK")
    assert (answer.type, answer.mission_type) == (ACCEPTED, 255)
    assert held(harness) == 0
