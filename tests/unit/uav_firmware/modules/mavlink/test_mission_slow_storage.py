"""Plans on slow storage: answered when stored, not cancelled, without blocking."""

from typing import Any

import pytest

from tests.support.slow_storage import SlowStorage
from tests.unit.uav_firmware.modules.mavlink.harness import (
    SYSTEM,
    MavlinkHarness,
    mission_count,
    mission_item,
)
from uav_firmware.modules.mavlink.wire.dialect import mavlink

ACCEPTED, ERROR, NO_SPACE = 0, 1, 4
SECOND_US = 1_000_000


def send(harness: MavlinkHarness, count: int, z: float) -> None:
    harness.send(mission_count(count, 0))
    for seq in range(count):
        harness.send(mission_item(seq, z=z))
    harness.run(SECOND_US)


def held(harness: MavlinkHarness) -> int:
    harness.received()
    message = mavlink.MAVLink_mission_request_list_message(SYSTEM, 1, 0)
    (count,) = harness.request(message, "MISSION_COUNT")
    return int(count.count)


def acks(harness: MavlinkHarness) -> list[int]:
    harness.run()
    return [ack.type for ack in harness.received("MISSION_ACK")]


@pytest.fixture
def scene() -> tuple[MavlinkHarness, SlowStorage]:
    storage = SlowStorage()
    return MavlinkHarness(storage=storage), storage


def test_a_plan_is_accepted_when_it_is_stored(
    scene: tuple[MavlinkHarness, SlowStorage],
) -> None:
    harness, storage = scene
    send(harness, 3, 10.0)
    harness.run(2 * SECOND_US)
    assert (acks(harness), held(harness)) == ([], 0)
    storage.end()
    assert acks(harness) == [ACCEPTED]
    assert held(harness) == held(MavlinkHarness(storage=storage)) == 3


def test_a_write_that_fails_late_leaves_the_previous_plan(
    scene: tuple[MavlinkHarness, SlowStorage],
) -> None:
    harness, storage = scene
    send(harness, 3, 10.0)
    storage.end()
    assert acks(harness) == [ACCEPTED]
    send(harness, 5, 20.0)
    storage.end(full=True)
    assert acks(harness) == [NO_SPACE]
    assert held(harness) == held(MavlinkHarness(storage=storage)) == 3


@pytest.mark.parametrize(
    "change_of_mind",
    [
        mavlink.MAVLink_mission_ack_message(SYSTEM, 1, 15, 0),
        mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 0),
        mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 255),
        mission_count(0, 0),
        mission_count(7, 0),
    ],
    ids=["cancel", "clear", "clear all", "count 0", "count 7"],
)
def test_a_plan_being_written_cannot_be_cancelled(
    scene: tuple[MavlinkHarness, SlowStorage], change_of_mind: Any
) -> None:
    """Otherwise storage and vehicle would have different plans until the next restart."""
    harness, storage = scene
    send(harness, 3, 10.0)
    harness.send(change_of_mind)
    harness.run(SECOND_US)
    assert storage.waiting == 1
    storage.end()
    assert acks(harness) == [ACCEPTED]
    assert held(harness) == held(MavlinkHarness(storage=storage)) == 3


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("message", "kinds"),
    [
        (mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 0), 1),
        (mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 255), 3),
        (mission_count(0, 0), 1),
    ],
    ids=["clear", "clear all", "count 0"],
)
def test_a_removal_is_answered_once_when_it_is_stored(
    scene: tuple[MavlinkHarness, SlowStorage], message: Any, kinds: int
) -> None:
    harness, storage = scene
    send(harness, 3, 10.0)
    storage.end()
    harness.run(2 * SECOND_US)
    harness.received()
    harness.send(message)
    for _ in range(kinds):
        harness.run(SECOND_US)
        assert acks(harness) == []
        storage.end()
    assert acks(harness) == [ACCEPTED]
    assert held(harness) == held(MavlinkHarness(storage=storage)) == 0


@pytest.fixture
def hung(scene: tuple[MavlinkHarness, SlowStorage]) -> tuple[MavlinkHarness, SlowStorage]:
    """A vehicle with three items whose write of five has timed out."""
    harness, storage = scene
    send(harness, 3, 10.0)
    storage.end()
    assert acks(harness) == [ACCEPTED]
    harness.received()
    send(harness, 5, 20.0)
    harness.run(13 * SECOND_US)
    assert acks(harness) == []
    harness.run(2 * SECOND_US)
    received = harness.received()
    assert [each.type for each in received if each.get_type() == "MISSION_ACK"] == [ERROR]
    texts = [each.text for each in received if each.get_type() == "STATUSTEXT"]
    assert "not saved: the storage does not answer" in "".join(texts)
    return harness, storage


@pytest.mark.first_case
@pytest.mark.parametrize(
    "message",
    [
        mission_count(7, 0),
        mission_count(0, 0),
        mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 0),
    ],
    ids=["count 7", "count 0", "clear"],
)
def test_while_storage_blocks_uploads_are_refused_and_the_previous_plan_stays(
    hung: tuple[MavlinkHarness, SlowStorage], message: Any
) -> None:
    harness, storage = hung
    harness.send(message)
    assert acks(harness) == [ERROR]
    assert (held(harness), storage.waiting) == (3, 1)


def test_after_a_late_write_the_previous_plan_is_stored_again(
    hung: tuple[MavlinkHarness, SlowStorage],
) -> None:
    harness, storage = hung
    storage.end()
    assert held(MavlinkHarness(storage=storage)) == 5
    harness.run(SECOND_US)
    harness.send(mission_count(7, 0))
    assert acks(harness) == [ERROR]
    storage.end(full=True)
    harness.run(2 * SECOND_US)
    storage.end()
    harness.run(SECOND_US)
    assert held(harness) == held(MavlinkHarness(storage=storage)) == 3
    send(harness, 4, 30.0)
    storage.end()
    assert acks(harness) == [ACCEPTED]
    assert held(harness) == held(MavlinkHarness(storage=storage)) == 4


def test_after_a_late_failure_nothing_is_written(
    hung: tuple[MavlinkHarness, SlowStorage],
) -> None:
    harness, storage = hung
    storage.end(full=True)
    harness.run(SECOND_US)
    assert storage.waiting == 0
    assert held(harness) == held(MavlinkHarness(storage=storage)) == 3
