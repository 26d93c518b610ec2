from collections.abc import Sequence
from itertools import pairwise
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


def texts(harness: MavlinkHarness, source: Any = GROUND) -> str:
    return "".join(chunk.text for chunk in harness.received("STATUSTEXT", at=source))


def upload(harness: MavlinkHarness, count: int, **sender: Any) -> list[Any]:
    """Upload waypoints like a correct client; return the acknowledgements."""
    source = sender.get("source", GROUND)
    harness.received(at=source)
    harness.send(mission_count(count), **sender)
    acks: list[Any] = []
    for _ in range(count + 1):
        harness.run()
        received = harness.received(at=source)
        acks += [m for m in received if m.get_type() == "MISSION_ACK"]
        for requested in (m for m in received if m.get_type() == "MISSION_REQUEST_INT"):
            harness.send(mission_item(requested.seq), **sender)
    return acks


def mission_of(harness: MavlinkHarness) -> Mission:
    mission = harness.topics.mission.value
    assert mission is not None
    return mission


def progress_of(
    mission: Mission, seq: int, *reached: int, count: int | None = None, state: int = 3
) -> MissionProgress:
    """Publish the progress of a mission: current item, reached items, number of items."""
    total = len(mission.items)
    last, number = (reached[-1] if reached else -1), len(reached) if count is None else count
    return MissionProgress(
        0, mission.mission_id, seq, total, last, number, state, mission.time_us, 0, reached
    )


def types(messages: list[Any]) -> list[int]:
    return [message.type for message in messages]


def test_a_mission_arrives_whole_with_one_acknowledgement_and_its_id() -> None:
    harness = MavlinkHarness()
    (ack,) = upload(harness, 12)
    mission = mission_of(harness)
    assert (ack.type, ack.mission_type) == (ACCEPTED, MISSION)
    assert ack.opaque_id == mission.mission_id != 0
    assert [item.seq for item in mission.items] == list(range(12))
    assert mission.items[5].x == pytest.approx(40.4434005)
    (reported,) = harness.request(request_list(), "MISSION_COUNT")
    assert (reported.count, reported.opaque_id) == (12, ack.opaque_id)


def test_a_new_mission_is_reported_at_once_with_its_id() -> None:
    harness = MavlinkHarness()
    harness.run(SECOND_US)
    harness.send(mission_count(1))
    harness.run()
    harness.received()
    harness.send(mission_item(0))
    harness.run()
    reported = harness.received("MISSION_CURRENT", at=BROKER)[-1]
    assert reported.mission_id == mission_of(harness).mission_id
    assert (reported.seq, reported.total) == (0, 1)


def test_the_previous_mission_stays_until_the_new_one_is_complete() -> None:
    harness = MavlinkHarness()
    upload(harness, 3)
    before = mission_of(harness)
    harness.send(mission_count(2))
    harness.run()
    harness.send(mission_item(0, z=99.0))
    harness.run()
    assert mission_of(harness) is before
    (count,) = harness.request(request_list(), "MISSION_COUNT")
    assert count.count == 3
    harness.send(mission_item(1, z=99.0))
    harness.run()
    assert [item.z for item in mission_of(harness).items] == [99.0, 99.0]


def test_a_missing_item_is_requested_with_a_growing_interval() -> None:
    harness = MavlinkHarness()
    harness.send(mission_count(2))
    harness.run()
    times = []
    for _ in range(220):
        if harness.received("MISSION_REQUEST_INT"):
            times.append(harness.now_us)
        harness.run()
    gaps = [round((b - a) / 1e6, 2) for a, b in pairwise(times)]
    assert gaps[:7] == pytest.approx([0.25, 0.25, 0.25, 0.25, 0.5, 1.0, 1.0], abs=0.02)


def test_an_upload_times_out_after_15_seconds() -> None:
    harness = MavlinkHarness()
    upload(harness, 3)
    before = mission_of(harness)
    harness.send(mission_count(5))
    harness.run()
    harness.send(mission_item(0))
    harness.run(14 * SECOND_US)
    assert harness.received("MISSION_ACK") == []
    harness.send(mission_item(1))
    harness.run(14 * SECOND_US)
    assert harness.received("MISSION_ACK") == []
    harness.run(2 * SECOND_US)
    received = harness.received()
    assert types([m for m in received if m.get_type() == "MISSION_ACK"]) == [CANCELLED]
    (text,) = [m.text for m in received if m.get_type() == "STATUSTEXT"]
    assert "item 2 of 5" in text
    assert mission_of(harness) is before
    assert types(upload(harness, 4)) == [ACCEPTED]


def test_items_out_of_order_are_dropped_and_the_expected_one_requested() -> None:
    harness = MavlinkHarness()
    harness.send(mission_count(3))
    harness.run(100_000)
    harness.received()
    harness.send(mission_item(2))
    harness.run()
    assert [m.seq for m in harness.received("MISSION_REQUEST_INT")] == [0]
    for seq in (0, 0, 1, 0, 2):
        harness.send(mission_item(seq))
    harness.run()
    assert types(harness.received("MISSION_ACK")) == [ACCEPTED]
    assert len(mission_of(harness).items) == 3


def test_duplicates_do_not_multiply_requests() -> None:
    harness = MavlinkHarness()
    harness.send(mission_count(5))
    harness.run()
    harness.received()
    for _ in range(50):
        harness.send(mission_item(0))
    harness.run()
    assert [m.seq for m in harness.received("MISSION_REQUEST_INT")] == [1]


def test_only_a_repeated_last_item_is_acknowledged_again() -> None:
    harness = MavlinkHarness()
    (first,) = upload(harness, 3)
    (again,) = harness.request(mission_item(2), "MISSION_ACK")
    assert (again.type, again.opaque_id) == (ACCEPTED, first.opaque_id)
    assert harness.request(mission_item(1), "MISSION_ACK") == []
    assert harness.request(mission_item(2, z=55.0), "MISSION_ACK") == []
    assert harness.request(mission_item(2), "MISSION_ACK", system=99) == []
    assert mission_of(harness).items[2].z == 10.0


def test_the_last_item_of_an_incomplete_upload_is_never_acknowledged() -> None:
    harness = MavlinkHarness()
    upload(harness, 3)
    harness.send(mission_count(3))
    harness.run(16 * SECOND_US)
    harness.received()
    assert harness.request(mission_item(2), "MISSION_ACK") == []


def test_a_second_uploader_is_denied_and_the_first_continues() -> None:
    harness = MavlinkHarness()
    harness.send(mission_count(2))
    harness.run()
    harness.received()
    for message, refused in (
        (mission_count(7), "Mission upload"),
        (mission_item(0), "Mission upload"),
        (clear(), "MISSION_CLEAR_ALL"),
    ):
        (denied,) = harness.request(message, "MISSION_ACK", source=BROKER, system=99)
        assert (denied.type, denied.target_system) == (DENIED, 99)
        assert texts(harness) == f"{refused} refused: another peer uploads a plan"
    harness.send(mission_item(0))
    harness.send(mission_item(1))
    harness.run()
    assert types(harness.received("MISSION_ACK")) == [ACCEPTED]


def test_the_same_uploader_may_restart() -> None:
    harness = MavlinkHarness()
    harness.send(mission_count(3))
    harness.send(mission_item(0, z=99.0))
    harness.run()
    harness.received()
    assert types(upload(harness, 2)) == [ACCEPTED]
    assert [item.z for item in mission_of(harness).items] == [10.0, 10.0]


def test_two_stations_with_the_same_ids_make_no_mission_of_items_of_both() -> None:
    """Both have QGroundControl's 255; the second begins while an item of the first is under way."""
    harness = MavlinkHarness()
    harness.send(mission_count(2))
    harness.run()
    harness.send(mission_count(2), source=BROKER)
    harness.send(mission_item(0, z=99.0))
    harness.send(mavlink.MAVLink_mission_ack_message(SYSTEM, 1, CANCELLED, MISSION))
    harness.run()
    for seq in (0, 1):
        requests = harness.received("MISSION_REQUEST_INT", at=BROKER)
        assert [request.seq for request in requests] == [seq]
        harness.send(mission_item(seq, z=20.0), source=BROKER)
        harness.run()
    assert types(harness.received("MISSION_ACK", at=BROKER)) == [ACCEPTED]
    assert [item.z for item in mission_of(harness).items] == [20.0, 20.0]


def test_the_uploader_may_cancel() -> None:
    harness = MavlinkHarness()
    upload(harness, 1)
    harness.send(mission_count(3))
    harness.send(mavlink.MAVLink_mission_ack_message(SYSTEM, 1, CANCELLED, MISSION))
    harness.run(SECOND_US)
    harness.received()
    harness.run(20 * SECOND_US)
    received = {m.get_type() for m in harness.received()}
    assert not received & {"MISSION_REQUEST_INT", "MISSION_ACK", "STATUSTEXT"}
    assert len(mission_of(harness).items) == 1


def test_too_many_items_are_refused_with_the_limit() -> None:
    harness = MavlinkHarness()
    harness.send(mission_count(MAX_ITEMS + 1))
    harness.run()
    received = harness.received()
    assert types([m for m in received if m.get_type() == "MISSION_ACK"]) == [NO_SPACE]
    assert any("limit 2000" in m.text for m in received if m.get_type() == "STATUSTEXT")


@pytest.mark.parametrize(
    "removal", [clear(), clear(ALL), mission_count(0)], ids=["clear", "clear all", "count 0"]
)
def test_clear_all_and_an_empty_upload_remove_a_mission(removal: Any) -> None:
    harness = MavlinkHarness()
    upload(harness, 3)
    (ack,) = harness.request(removal, "MISSION_ACK")
    assert (ack.type, ack.opaque_id) == (ACCEPTED, 0)
    assert mission_of(harness).items == ()
    assert mission_of(harness).mission_id == 0
    (count,) = harness.request(request_list(), "MISSION_COUNT")
    assert count.count == 0


def test_items_can_be_downloaded_in_any_order_repeatedly() -> None:
    harness = MavlinkHarness()
    upload(harness, 6)
    for seq in (5, 0, 3, 3, 1):
        harness.send(request(seq))
    harness.send(mavlink.MAVLink_mission_request_message(SYSTEM, 1, 4, MISSION))
    harness.run()
    items = harness.received("MISSION_ITEM_INT")
    assert [item.seq for item in items] == [5, 0, 3, 3, 1, 4]
    assert (items[0].x, items[0].frame, items[0].target_system) == (404_434_005, 6, 255)
    harness.send(request(6), source=BROKER)
    assert types(harness.request(request(6), "MISSION_ACK")) == [INVALID_SEQUENCE]
    assert "MISSION_REQUEST_INT refused: item 6 of 6" in texts(harness, BROKER)


def test_the_current_item_is_marked_in_a_download() -> None:
    harness = MavlinkHarness()
    upload(harness, 3)
    harness.topics.mission_progress.publish(progress_of(mission_of(harness), 1, 0))
    for seq in range(3):
        harness.send(request(seq))
    harness.run()
    assert [item.current for item in harness.received("MISSION_ITEM_INT")] == [0, 1, 0]


@pytest.mark.parametrize("mission_type", [FENCE, RALLY])
def test_fence_and_rally_points_are_separate_plans(mission_type: int) -> None:
    harness = MavlinkHarness()
    upload(harness, 3)
    (requested,) = harness.request(mission_count(1, mission_type), "MISSION_REQUEST_INT")
    assert (requested.seq, requested.mission_type) == (0, mission_type)
    (ack,) = harness.request(mission_item(0, mission_type=mission_type), "MISSION_ACK")
    assert (ack.type, ack.mission_type) == (ACCEPTED, mission_type)
    topic = harness.topics.fence if mission_type == FENCE else harness.topics.rally_points
    assert topic.value is not None
    assert len(topic.value.items) == 1
    assert len(mission_of(harness).items) == 3
    (count,) = harness.request(request_list(mission_type), "MISSION_COUNT")
    assert (count.count, count.mission_type) == (1, mission_type)
    assert types(harness.request(clear(mission_type), "MISSION_ACK")) == [ACCEPTED]
    assert list(topic.value.items) == []
    assert len(mission_of(harness).items) == 3


@pytest.mark.parametrize("mission_type", [3, 17, 254])
def test_an_unknown_type_of_plan_is_invalid(mission_type: int) -> None:
    harness = MavlinkHarness()
    for message in (
        mission_count(2, mission_type),
        request_list(mission_type),
        request(0, mission_type),
        clear(mission_type),
        mission_item(0, mission_type=mission_type),
    ):
        harness.send(message, source=BROKER)
        (ack,) = harness.request(message, "MISSION_ACK")
        assert (ack.type, ack.mission_type) == (INVALID, mission_type)
        reason = f"{message.get_type()} refused: mission type {mission_type} is unknown"
        assert texts(harness, BROKER) == 2 * reason


def test_partial_lists_are_refused() -> None:
    harness = MavlinkHarness()
    read = mavlink.MAVLink_mission_request_partial_list_message(SYSTEM, 1, 0, 2, MISSION)
    write = mavlink.MAVLink_mission_write_partial_list_message(SYSTEM, 1, 0, 2, MISSION)
    for message in (read, write):
        harness.send(message, source=BROKER)
        assert types(harness.request(message, "MISSION_ACK")) == [UNSUPPORTED]
        reason = f"{message.get_type()} refused: partial lists are not supported"
        assert texts(harness, BROKER) == 2 * reason


def test_an_invalid_item_ends_the_upload_and_is_named() -> None:
    harness = MavlinkHarness()
    upload(harness, 2)
    before = mission_of(harness)
    harness.send(mission_count(3))
    harness.send(mission_item(0))
    harness.send(mission_item(1, frame=10))
    harness.run()
    received = harness.received()
    assert types([m for m in received if m.get_type() == "MISSION_ACK"]) == [UNSUPPORTED_FRAME]
    assert any("item 1" in m.text for m in received if m.get_type() == "STATUSTEXT")
    assert mission_of(harness) is before
    assert types(harness.request(mission_item(1, frame=10), "MISSION_ACK")) == [UNSUPPORTED_FRAME]


@pytest.mark.parametrize(
    ("reason", "reported"),
    [
        ("DO_ORBIT is no item", "upload refused: item 1: DO_ORBIT is no item"),
        ("item 1 (DO_ORBIT): is no item", "upload refused: item 1 (DO_ORBIT): is no item"),
        ("item 10 is missing", "upload refused: item 1: item 10 is missing"),
    ],
)
def test_an_infeasible_mission_is_refused(reason: str, reported: str) -> None:
    """The text names the item once: ground stations show 50 characters at a time."""

    def check(items: Sequence[MissionItem]) -> MissionRejection | None:
        faulty = [item.seq for item in items if item.command == 34]
        return MissionRejection(faulty[0], UNSUPPORTED, reason) if faulty else None

    harness = MavlinkHarness(check=check)
    upload(harness, 2)
    before = mission_of(harness)
    harness.send(mission_count(2))
    harness.send(mission_item(0))
    harness.send(mission_item(1, 34))
    harness.run()
    received = harness.received()
    assert types([m for m in received if m.get_type() == "MISSION_ACK"]) == [UNSUPPORTED]
    texts = "".join(m.text for m in received if m.get_type() == "STATUSTEXT")
    assert texts.endswith(reported)
    assert mission_of(harness) is before
    assert types(harness.request(mission_item(1, 34), "MISSION_ACK")) == [UNSUPPORTED]


@pytest.mark.parametrize(("system", "component"), [(SYSTEM + 1, 1), (0, 0), (SYSTEM, 100)])
def test_messages_for_another_system_are_ignored(system: int, component: int) -> None:
    harness = MavlinkHarness()
    harness.received()
    harness.send(mavlink.MAVLink_mission_count_message(system, component, 3, MISSION))
    harness.send(mavlink.MAVLink_mission_request_list_message(system, component, MISSION))
    harness.run()
    received = {m.get_type() for m in harness.received()}
    assert not received & {"MISSION_REQUEST_INT", "MISSION_COUNT", "MISSION_ACK"}


def test_a_reached_item_is_sent_at_once_and_three_times_more() -> None:
    harness = MavlinkHarness()
    upload(harness, 4)
    mission = mission_of(harness)
    harness.topics.mission_progress.publish(progress_of(mission, 2, 1))
    harness.run()
    assert [m.seq for m in harness.received("MISSION_ITEM_REACHED")] == [1]
    harness.run(5 * SECOND_US)
    assert [m.seq for m in harness.received("MISSION_ITEM_REACHED")] == [1, 1, 1]
    harness.topics.mission_progress.publish(progress_of(mission, 3, 1, 2))
    harness.run(600_000)
    assert [m.seq for m in harness.received("MISSION_ITEM_REACHED")] == [2, 2]
    later = mission._replace(time_us=mission.time_us + 1)
    harness.topics.mission_progress.publish(progress_of(later, 0, count=2, state=2))
    harness.run(5 * SECOND_US)
    assert harness.received("MISSION_ITEM_REACHED") == []


def test_every_item_reached_between_two_ticks_is_sent() -> None:
    harness = MavlinkHarness()
    upload(harness, 6)
    harness.topics.mission_progress.publish(progress_of(mission_of(harness), 4, 0, 1, 2, 3))
    harness.run()
    assert [m.seq for m in harness.received("MISSION_ITEM_REACHED")] == [0, 1, 2, 3]
    harness.run(5 * SECOND_US)
    assert [m.seq for m in harness.received("MISSION_ITEM_REACHED")] == [3, 3, 3]


def test_the_same_mission_again_begins_at_its_first_item_at_once() -> None:
    harness = MavlinkHarness()
    upload(harness, 6)
    harness.topics.mission_progress.publish(progress_of(mission_of(harness), 5, 4))
    harness.run()
    harness.received(at=BROKER)
    upload(harness, 6)
    harness.run()
    reported = harness.received("MISSION_CURRENT", at=BROKER)
    assert reported
    assert {message.seq for message in reported} == {0}


def test_a_selected_item_is_reported_each_time() -> None:
    harness = MavlinkHarness()
    upload(harness, 6)
    progress = progress_of(mission_of(harness), 2, 1)
    harness.topics.mission_progress.publish(progress)
    harness.run(1_500_000)
    harness.received(at=BROKER)
    harness.topics.mission_progress.publish(progress._replace(selection_count=1))
    harness.run()
    assert [m.seq for m in harness.received("MISSION_CURRENT", at=BROKER)] == [2]


def test_fence_and_rally_ids_are_reported_with_and_without_a_mission() -> None:
    harness = MavlinkHarness()
    for mission_type in (FENCE, RALLY):
        harness.send(mission_count(1, mission_type))
        harness.send(mission_item(0, z=5.0 + mission_type, mission_type=mission_type))
    harness.run(40_000)  # The rally points are checked after the geofence
    ids = [ack.opaque_id for ack in harness.received("MISSION_ACK")]
    reported = harness.received("MISSION_CURRENT", at=BROKER)[-1]
    assert [reported.fence_id, reported.rally_points_id] == ids
    assert (reported.mission_id, reported.total) == (0, 0xFFFF)
    upload(harness, 2)
    reported = harness.received("MISSION_CURRENT", at=BROKER)[-1]
    assert [reported.fence_id, reported.rally_points_id] == ids
    assert reported.mission_id == mission_of(harness).mission_id
