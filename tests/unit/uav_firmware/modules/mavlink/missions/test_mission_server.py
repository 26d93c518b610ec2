from collections.abc import Sequence
from itertools import pairwise
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
from uav_firmware.modules.mavlink.missions.mission_store import MAX_ITEMS
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.mission import Mission, MissionItem, MissionProgress, MissionRejection

ACCEPTED, UNSUPPORTED_FRAME, UNSUPPORTED, NO_SPACE, INVALID = 0, 2, 3, 4, 5
INVALID_SEQUENCE, DENIED, CANCELLED = 13, 14, 15
MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255
SECOND_US = 1_000_000


def request_list(mission_type: int = MISSION) -> Any:
    return mavlink.MAVLink_mission_request_list_message(SYSTEM, 1, mission_type)


def request(seq: int, mission_type: int = MISSION) -> Any:
    return mavlink.MAVLink_mission_request_int_message(SYSTEM, 1, seq, mission_type)


def clear(mission_type: int = MISSION) -> Any:
    return mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, mission_type)


def upload(bench: Bench, count: int, **sender: Any) -> list[Any]:
    """Upload waypoints as a proper client does; gives the acknowledgements."""
    source = sender.get("source", GROUND)
    bench.hear(at=source)
    bench.say(mission_count(count), **sender)
    acks: list[Any] = []
    for _ in range(count + 1):
        bench.run()
        heard = bench.hear(at=source)
        acks += [m for m in heard if m.get_type() == "MISSION_ACK"]
        for asked in (m for m in heard if m.get_type() == "MISSION_REQUEST_INT"):
            bench.say(mission_item(asked.seq), **sender)
    return acks


def mission_of(bench: Bench) -> Mission:
    mission = bench.topics.mission.value
    assert mission is not None
    return mission


def progress_of(
    mission: Mission, seq: int, *reached: int, count: int | None = None, state: int = 3
) -> MissionProgress:
    """The navigator's word on a mission: item to fly, items reached and how many in all."""
    total = len(mission.items)
    last, number = (reached[-1] if reached else -1), len(reached) if count is None else count
    return MissionProgress(
        0, mission.mission_id, seq, total, last, number, state, mission.time_us, 0, reached
    )


def types(messages: list[Any]) -> list[int]:
    return [message.type for message in messages]


def test_a_mission_arrives_whole_with_one_acknowledgement_and_its_id() -> None:
    bench = Bench()
    (ack,) = upload(bench, 12)
    mission = mission_of(bench)
    assert (ack.type, ack.mission_type) == (ACCEPTED, MISSION)
    assert ack.opaque_id == mission.mission_id != 0
    assert [item.seq for item in mission.items] == list(range(12))
    assert mission.items[5].x == pytest.approx(40.4434005)
    (told,) = bench.ask(request_list(), "MISSION_COUNT")
    assert (told.count, told.opaque_id) == (12, ack.opaque_id)


def test_a_new_mission_is_told_at_once_with_its_id() -> None:
    bench = Bench()
    bench.run(SECOND_US)
    bench.say(mission_count(1))
    bench.run()
    bench.hear()
    bench.say(mission_item(0))
    bench.run()
    told = bench.hear("MISSION_CURRENT", at=BROKER)[-1]
    assert told.mission_id == mission_of(bench).mission_id
    assert (told.seq, told.total) == (0, 1)


def test_the_old_mission_stays_until_the_new_one_is_complete() -> None:
    bench = Bench()
    upload(bench, 3)
    before = mission_of(bench)
    bench.say(mission_count(2))
    bench.run()
    bench.say(mission_item(0, z=99.0))
    bench.run()
    assert mission_of(bench) is before
    (count,) = bench.ask(request_list(), "MISSION_COUNT")
    assert count.count == 3
    bench.say(mission_item(1, z=99.0))
    bench.run()
    assert [item.z for item in mission_of(bench).items] == [99.0, 99.0]


def test_an_item_that_stays_away_is_asked_for_with_a_growing_interval() -> None:
    bench = Bench()
    bench.say(mission_count(2))
    bench.run()
    times = []
    for _ in range(220):
        if bench.hear("MISSION_REQUEST_INT"):
            times.append(bench.now_us)
        bench.run()
    gaps = [round((b - a) / 1e6, 2) for a, b in pairwise(times)]
    assert gaps[:7] == pytest.approx([0.25, 0.25, 0.25, 0.25, 0.5, 1.0, 1.0], abs=0.02)


def test_a_silent_upload_ends_after_15_seconds_with_an_answer_and_a_text() -> None:
    bench = Bench()
    upload(bench, 3)
    before = mission_of(bench)
    bench.say(mission_count(5))
    bench.run()
    bench.say(mission_item(0))
    bench.run(14 * SECOND_US)
    assert bench.hear("MISSION_ACK") == []
    bench.say(mission_item(1))
    bench.run(14 * SECOND_US)
    assert bench.hear("MISSION_ACK") == []
    bench.run(2 * SECOND_US)
    heard = bench.hear()
    assert types([m for m in heard if m.get_type() == "MISSION_ACK"]) == [CANCELLED]
    (text,) = [m.text for m in heard if m.get_type() == "STATUSTEXT"]
    assert "item 2 of 5" in text
    assert mission_of(bench) is before
    assert types(upload(bench, 4)) == [ACCEPTED]


def test_items_out_of_order_are_dropped_and_the_right_one_is_asked_for() -> None:
    bench = Bench()
    bench.say(mission_count(3))
    bench.run(100_000)
    bench.hear()
    bench.say(mission_item(2))
    bench.run()
    assert [m.seq for m in bench.hear("MISSION_REQUEST_INT")] == [0]
    for seq in (0, 0, 1, 0, 2):
        bench.say(mission_item(seq))
    bench.run()
    assert types(bench.hear("MISSION_ACK")) == [ACCEPTED]
    assert len(mission_of(bench).items) == 3


def test_duplicates_do_not_multiply_requests() -> None:
    bench = Bench()
    bench.say(mission_count(5))
    bench.run()
    bench.hear()
    for _ in range(50):
        bench.say(mission_item(0))
    bench.run()
    assert [m.seq for m in bench.hear("MISSION_REQUEST_INT")] == [1]


def test_the_last_item_again_is_acknowledged_again_and_nothing_else_is() -> None:
    bench = Bench()
    (first,) = upload(bench, 3)
    (again,) = bench.ask(mission_item(2), "MISSION_ACK")
    assert (again.type, again.opaque_id) == (ACCEPTED, first.opaque_id)
    assert bench.ask(mission_item(1), "MISSION_ACK") == []
    assert bench.ask(mission_item(2, z=55.0), "MISSION_ACK") == []
    assert bench.ask(mission_item(2), "MISSION_ACK", system=99) == []
    assert mission_of(bench).items[2].z == 10.0


def test_the_last_item_of_an_incomplete_upload_is_never_acknowledged() -> None:
    bench = Bench()
    upload(bench, 3)
    bench.say(mission_count(3))
    bench.run(16 * SECOND_US)
    bench.hear()
    assert bench.ask(mission_item(2), "MISSION_ACK") == []


def test_a_foreign_uploader_is_denied_and_the_first_goes_on() -> None:
    bench = Bench()
    bench.say(mission_count(2))
    bench.run()
    (denied,) = bench.ask(mission_count(7), "MISSION_ACK", source=BROKER, system=99)
    assert (denied.type, denied.target_system) == (DENIED, 99)
    (denied,) = bench.ask(mission_item(0), "MISSION_ACK", source=BROKER, system=99)
    assert denied.type == DENIED
    (denied,) = bench.ask(clear(), "MISSION_ACK", source=BROKER, system=99)
    assert denied.type == DENIED
    bench.say(mission_item(0))
    bench.say(mission_item(1))
    bench.run()
    assert types(bench.hear("MISSION_ACK")) == [ACCEPTED]


def test_the_same_uploader_may_begin_again() -> None:
    bench = Bench()
    bench.say(mission_count(3))
    bench.say(mission_item(0, z=99.0))
    bench.run()
    bench.hear()
    assert types(upload(bench, 2)) == [ACCEPTED]
    assert [item.z for item in mission_of(bench).items] == [10.0, 10.0]


def test_the_uploader_may_cancel() -> None:
    bench = Bench()
    upload(bench, 1)
    bench.say(mission_count(3))
    bench.say(mavlink.MAVLink_mission_ack_message(SYSTEM, 1, CANCELLED, MISSION))
    bench.run(SECOND_US)
    bench.hear()
    bench.run(20 * SECOND_US)
    heard = {m.get_type() for m in bench.hear()}
    assert not heard & {"MISSION_REQUEST_INT", "MISSION_ACK", "STATUSTEXT"}
    assert len(mission_of(bench).items) == 1


def test_more_items_than_fit_are_refused_with_the_limit_in_words() -> None:
    bench = Bench()
    bench.say(mission_count(MAX_ITEMS + 1))
    bench.run()
    heard = bench.hear()
    assert types([m for m in heard if m.get_type() == "MISSION_ACK"]) == [NO_SPACE]
    assert any("2000 fit" in m.text for m in heard if m.get_type() == "STATUSTEXT")


@pytest.mark.parametrize(
    "removal", [clear(), clear(ALL), mission_count(0)], ids=["clear", "clear all", "count 0"]
)
def test_a_mission_is_removed_in_every_way(removal: Any) -> None:
    bench = Bench()
    upload(bench, 3)
    (ack,) = bench.ask(removal, "MISSION_ACK")
    assert (ack.type, ack.opaque_id) == (ACCEPTED, 0)
    assert mission_of(bench).items == ()
    assert mission_of(bench).mission_id == 0
    (count,) = bench.ask(request_list(), "MISSION_COUNT")
    assert count.count == 0


def test_a_download_serves_any_order_any_number_of_times() -> None:
    bench = Bench()
    upload(bench, 6)
    for seq in (5, 0, 3, 3, 1):
        bench.say(request(seq))
    bench.say(mavlink.MAVLink_mission_request_message(SYSTEM, 1, 4, MISSION))
    bench.run()
    items = bench.hear("MISSION_ITEM_INT")
    assert [item.seq for item in items] == [5, 0, 3, 3, 1, 4]
    assert (items[0].x, items[0].frame, items[0].target_system) == (404_434_005, 6, 255)
    assert types(bench.ask(request(6), "MISSION_ACK")) == [INVALID_SEQUENCE]


def test_the_current_item_is_marked_in_a_download() -> None:
    bench = Bench()
    upload(bench, 3)
    bench.topics.mission_progress.publish(progress_of(mission_of(bench), 1, 0))
    for seq in range(3):
        bench.say(request(seq))
    bench.run()
    assert [item.current for item in bench.hear("MISSION_ITEM_INT")] == [0, 1, 0]


@pytest.mark.parametrize("mission_type", [FENCE, RALLY])
def test_fence_and_rally_points_are_plans_of_their_own(mission_type: int) -> None:
    bench = Bench()
    upload(bench, 3)
    (asked,) = bench.ask(mission_count(1, mission_type), "MISSION_REQUEST_INT")
    assert (asked.seq, asked.mission_type) == (0, mission_type)
    (ack,) = bench.ask(mission_item(0, mission_type=mission_type), "MISSION_ACK")
    assert (ack.type, ack.mission_type) == (ACCEPTED, mission_type)
    topic = bench.topics.fence if mission_type == FENCE else bench.topics.rally_points
    assert topic.value is not None
    assert len(topic.value.items) == 1
    assert len(mission_of(bench).items) == 3
    (count,) = bench.ask(request_list(mission_type), "MISSION_COUNT")
    assert (count.count, count.mission_type) == (1, mission_type)
    assert types(bench.ask(clear(mission_type), "MISSION_ACK")) == [ACCEPTED]
    assert list(topic.value.items) == []
    assert len(mission_of(bench).items) == 3


@pytest.mark.parametrize("mission_type", [3, 17, 254])
def test_an_unknown_type_of_plan_is_invalid(mission_type: int) -> None:
    bench = Bench()
    for message in (
        mission_count(2, mission_type),
        request_list(mission_type),
        request(0, mission_type),
        clear(mission_type),
        mission_item(0, mission_type=mission_type),
    ):
        (ack,) = bench.ask(message, "MISSION_ACK")
        assert (ack.type, ack.mission_type) == (INVALID, mission_type)


def test_partial_lists_are_refused() -> None:
    bench = Bench()
    read = mavlink.MAVLink_mission_request_partial_list_message(SYSTEM, 1, 0, 2, MISSION)
    write = mavlink.MAVLink_mission_write_partial_list_message(SYSTEM, 1, 0, 2, MISSION)
    assert types(bench.ask(read, "MISSION_ACK")) == [UNSUPPORTED]
    assert types(bench.ask(write, "MISSION_ACK")) == [UNSUPPORTED]


def test_a_faulty_item_ends_the_upload_and_is_named() -> None:
    bench = Bench()
    upload(bench, 2)
    before = mission_of(bench)
    bench.say(mission_count(3))
    bench.say(mission_item(0))
    bench.say(mission_item(1, frame=10))
    bench.run()
    heard = bench.hear()
    assert types([m for m in heard if m.get_type() == "MISSION_ACK"]) == [UNSUPPORTED_FRAME]
    assert any("item 1" in m.text for m in heard if m.get_type() == "STATUSTEXT")
    assert mission_of(bench) is before
    assert types(bench.ask(mission_item(1, frame=10), "MISSION_ACK")) == [UNSUPPORTED_FRAME]


def test_an_infeasible_mission_is_refused_before_the_acknowledgement() -> None:
    def check(items: Sequence[MissionItem]) -> MissionRejection | None:
        faulty = [item.seq for item in items if item.command == 34]
        return MissionRejection(faulty[0], UNSUPPORTED, "DO_ORBIT is no item") if faulty else None

    bench = Bench(check=check)
    upload(bench, 2)
    before = mission_of(bench)
    bench.say(mission_count(2))
    bench.say(mission_item(0))
    bench.say(mission_item(1, 34))
    bench.run()
    heard = bench.hear()
    assert types([m for m in heard if m.get_type() == "MISSION_ACK"]) == [UNSUPPORTED]
    texts = "".join(m.text for m in heard if m.get_type() == "STATUSTEXT")
    assert "item 1: DO_ORBIT is no item" in texts
    assert mission_of(bench) is before
    assert types(bench.ask(mission_item(1, 34), "MISSION_ACK")) == [UNSUPPORTED]


@pytest.mark.parametrize(("system", "component"), [(SYSTEM + 1, 1), (0, 0), (SYSTEM, 100)])
def test_messages_for_somebody_else_are_ignored(system: int, component: int) -> None:
    bench = Bench()
    bench.hear()
    bench.say(mavlink.MAVLink_mission_count_message(system, component, 3, MISSION))
    bench.say(mavlink.MAVLink_mission_request_list_message(system, component, MISSION))
    bench.run()
    heard = {m.get_type() for m in bench.hear()}
    assert not heard & {"MISSION_REQUEST_INT", "MISSION_COUNT", "MISSION_ACK"}


def test_an_item_reached_is_told_at_once_and_three_times_more() -> None:
    bench = Bench()
    upload(bench, 4)
    mission = mission_of(bench)
    bench.topics.mission_progress.publish(progress_of(mission, 2, 1))
    bench.run()
    assert [m.seq for m in bench.hear("MISSION_ITEM_REACHED")] == [1]
    bench.run(5 * SECOND_US)
    assert [m.seq for m in bench.hear("MISSION_ITEM_REACHED")] == [1, 1, 1]
    bench.topics.mission_progress.publish(progress_of(mission, 3, 1, 2))
    bench.run(600_000)
    assert [m.seq for m in bench.hear("MISSION_ITEM_REACHED")] == [2, 2]
    later = mission._replace(time_us=mission.time_us + 1)
    bench.topics.mission_progress.publish(progress_of(later, 0, count=2, state=2))
    bench.run(5 * SECOND_US)
    assert bench.hear("MISSION_ITEM_REACHED") == []


def test_no_item_is_passed_over_that_was_reached_between_two_looks() -> None:
    bench = Bench()
    upload(bench, 6)
    bench.topics.mission_progress.publish(progress_of(mission_of(bench), 4, 0, 1, 2, 3))
    bench.run()
    assert [m.seq for m in bench.hear("MISSION_ITEM_REACHED")] == [0, 1, 2, 3]
    bench.run(5 * SECOND_US)
    assert [m.seq for m in bench.hear("MISSION_ITEM_REACHED")] == [3, 3, 3]


def test_the_same_mission_again_begins_at_its_first_item_at_once() -> None:
    bench = Bench()
    upload(bench, 6)
    bench.topics.mission_progress.publish(progress_of(mission_of(bench), 5, 4))
    bench.run()
    bench.hear(at=BROKER)
    upload(bench, 6)
    bench.run()
    told = bench.hear("MISSION_CURRENT", at=BROKER)
    assert told
    assert {message.seq for message in told} == {0}


def test_the_current_item_is_told_whenever_it_was_chosen() -> None:
    bench = Bench()
    upload(bench, 6)
    progress = progress_of(mission_of(bench), 2, 1)
    bench.topics.mission_progress.publish(progress)
    bench.run(1_500_000)
    bench.hear(at=BROKER)
    bench.topics.mission_progress.publish(progress._replace(selection_count=1))
    bench.run()
    assert [m.seq for m in bench.hear("MISSION_CURRENT", at=BROKER)] == [2]


def test_the_ids_of_fence_and_rally_points_are_told_with_and_without_a_mission() -> None:
    bench = Bench()
    for mission_type in (FENCE, RALLY):
        bench.say(mission_count(1, mission_type))
        bench.say(mission_item(0, z=5.0 + mission_type, mission_type=mission_type))
    bench.run()
    ids = [ack.opaque_id for ack in bench.hear("MISSION_ACK")]
    told = bench.hear("MISSION_CURRENT", at=BROKER)[-1]
    assert [told.fence_id, told.rally_points_id] == ids
    assert (told.mission_id, told.total) == (0, 0xFFFF)
    upload(bench, 2)
    told = bench.hear("MISSION_CURRENT", at=BROKER)[-1]
    assert [told.fence_id, told.rally_points_id] == ids
    assert told.mission_id == mission_of(bench).mission_id
