"""Plans on a slow medium: answered when it has them, given up by nobody, waited for by no step."""

from typing import Any

import pytest

from tests.support.slow_storage import SlowStorage
from tests.unit.uav_firmware.modules.mavlink.harness import (
    SYSTEM,
    Bench,
    mission_count,
    mission_item,
)
from uav_firmware.modules.mavlink.wire.dialect import mavlink

ACCEPTED, ERROR, NO_SPACE = 0, 1, 4
SECOND_US = 1_000_000


def send(bench: Bench, count: int, z: float) -> None:
    bench.say(mission_count(count, 0))
    for seq in range(count):
        bench.say(mission_item(seq, z=z))
    bench.run(SECOND_US)


def held(bench: Bench) -> int:
    bench.hear()
    message = mavlink.MAVLink_mission_request_list_message(SYSTEM, 1, 0)
    (count,) = bench.ask(message, "MISSION_COUNT")
    return int(count.count)


def acks(bench: Bench) -> list[int]:
    bench.run()
    return [ack.type for ack in bench.hear("MISSION_ACK")]


@pytest.fixture
def scene() -> tuple[Bench, SlowStorage]:
    storage = SlowStorage()
    return Bench(storage=storage), storage


def test_a_plan_is_accepted_when_the_medium_has_it(scene: tuple[Bench, SlowStorage]) -> None:
    bench, storage = scene
    send(bench, 3, 10.0)
    bench.run(2 * SECOND_US)
    assert (acks(bench), held(bench)) == ([], 0)
    storage.end()
    assert acks(bench) == [ACCEPTED]
    assert held(bench) == held(Bench(storage=storage)) == 3


def test_a_plan_that_the_medium_refuses_late_leaves_the_former_one(
    scene: tuple[Bench, SlowStorage],
) -> None:
    bench, storage = scene
    send(bench, 3, 10.0)
    storage.end()
    assert acks(bench) == [ACCEPTED]
    send(bench, 5, 20.0)
    storage.end(full=True)
    assert acks(bench) == [NO_SPACE]
    assert held(bench) == held(Bench(storage=storage)) == 3


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
def test_what_is_being_written_is_the_plan_whatever_comes_meanwhile(
    scene: tuple[Bench, SlowStorage], change_of_mind: Any
) -> None:
    """Else the medium would hold one plan and the vehicle another, until the next restart."""
    bench, storage = scene
    send(bench, 3, 10.0)
    bench.say(change_of_mind)
    bench.run(SECOND_US)
    assert storage.waiting == 1
    storage.end()
    assert acks(bench) == [ACCEPTED]
    assert held(bench) == held(Bench(storage=storage)) == 3


@pytest.mark.parametrize(
    ("message", "kinds"),
    [
        (mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 0), 1),
        (mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 255), 3),
        (mission_count(0, 0), 1),
    ],
    ids=["clear", "clear all", "count 0"],
)
def test_a_removal_is_answered_once_when_the_medium_has_it(
    scene: tuple[Bench, SlowStorage], message: Any, kinds: int
) -> None:
    bench, storage = scene
    send(bench, 3, 10.0)
    storage.end()
    bench.run(2 * SECOND_US)
    bench.hear()
    bench.say(message)
    for _ in range(kinds):
        bench.run(SECOND_US)
        assert acks(bench) == []
        storage.end()
    assert acks(bench) == [ACCEPTED]
    assert held(bench) == held(Bench(storage=storage)) == 0


@pytest.fixture
def hung(scene: tuple[Bench, SlowStorage]) -> tuple[Bench, SlowStorage]:
    """A vehicle that holds three items and has waited in vain for its medium to take five."""
    bench, storage = scene
    send(bench, 3, 10.0)
    storage.end()
    assert acks(bench) == [ACCEPTED]
    bench.hear()
    send(bench, 5, 20.0)
    bench.run(13 * SECOND_US)
    assert acks(bench) == []
    bench.run(2 * SECOND_US)
    heard = bench.hear()
    assert [each.type for each in heard if each.get_type() == "MISSION_ACK"] == [ERROR]
    texts = [each.text for each in heard if each.get_type() == "STATUSTEXT"]
    assert "not saved: the medium does not answer" in "".join(texts)
    return bench, storage


@pytest.mark.parametrize(
    "message",
    [
        mission_count(7, 0),
        mission_count(0, 0),
        mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 0),
    ],
    ids=["count 7", "count 0", "clear"],
)
def test_while_the_medium_hangs_every_upload_is_refused_and_the_former_plan_stays(
    hung: tuple[Bench, SlowStorage], message: Any
) -> None:
    bench, storage = hung
    bench.say(message)
    assert acks(bench) == [ERROR]
    assert (held(bench), storage.waiting) == (3, 1)


def test_after_a_write_that_ended_too_late_the_medium_gets_the_former_plan_again(
    hung: tuple[Bench, SlowStorage],
) -> None:
    bench, storage = hung
    storage.end()
    assert held(Bench(storage=storage)) == 5
    bench.run(SECOND_US)
    bench.say(mission_count(7, 0))
    assert acks(bench) == [ERROR]
    storage.end(full=True)
    bench.run(2 * SECOND_US)
    storage.end()
    bench.run(SECOND_US)
    assert held(bench) == held(Bench(storage=storage)) == 3
    send(bench, 4, 30.0)
    storage.end()
    assert acks(bench) == [ACCEPTED]
    assert held(bench) == held(Bench(storage=storage)) == 4


def test_after_a_write_that_failed_too_late_nothing_is_written_again(
    hung: tuple[Bench, SlowStorage],
) -> None:
    bench, storage = hung
    storage.end(full=True)
    bench.run(SECOND_US)
    assert storage.waiting == 0
    assert held(bench) == held(Bench(storage=storage)) == 3
