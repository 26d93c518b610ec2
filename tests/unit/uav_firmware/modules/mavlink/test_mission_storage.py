"""Stored plans after a restart: complete or not used."""

import errno
from typing import Any

import pytest

from tests.support.memory_storage import MemoryStorage
from tests.unit.uav_firmware.modules.mavlink.harness import (
    SYSTEM,
    MavlinkHarness,
    mission_count,
    mission_item,
)
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.mission import MissionRejection

ACCEPTED, ERROR, NO_SPACE = 0, 1, 4
FILES = ("mission.plan", "geofence.plan", "rally.plan")


def upload(harness: MavlinkHarness, count: int, mission_type: int = 0, **fields: Any) -> Any:
    harness.received()
    harness.send(mission_count(count, mission_type))
    for seq in range(count):
        harness.send(mission_item(seq, mission_type=mission_type, **fields))
    harness.run()
    (ack,) = harness.received("MISSION_ACK")
    return ack


def held(harness: MavlinkHarness, mission_type: int = 0) -> Any:
    message = mavlink.MAVLink_mission_request_list_message(SYSTEM, 1, mission_type)
    (count,) = harness.request(message, "MISSION_COUNT")
    return count


def texts(harness: MavlinkHarness) -> str:
    harness.run()
    return "".join(m.text for m in harness.received("STATUSTEXT"))


def test_every_plan_and_its_id_survive_a_restart() -> None:
    storage = MemoryStorage()
    harness = MavlinkHarness(storage=storage)
    acks = [upload(harness, 3 + kind, kind, z=20.0 + kind) for kind in range(3)]
    again = MavlinkHarness(storage=storage)
    for kind, ack in enumerate(acks):
        count = held(again, kind)
        assert (count.count, count.opaque_id) == (3 + kind, ack.opaque_id)
        topic = (again.topics.mission, again.topics.fence, again.topics.rally_points)[kind]
        assert topic.value is not None
        assert [item.z for item in topic.value.items] == [20.0 + kind] * (3 + kind)
    assert texts(again) == ""


def test_a_mission_from_before_the_restart_begins_at_its_first_item() -> None:
    storage = MemoryStorage()
    upload(MavlinkHarness(storage=storage), 4)
    again = MavlinkHarness(storage=storage)
    again.run(1_100_000)
    reported = again.received("MISSION_CURRENT")[-1]
    assert (reported.seq, reported.total, reported.mission_state) == (0, 4, 2)


def test_a_removed_plan_stays_removed() -> None:
    storage = MemoryStorage()
    harness = MavlinkHarness(storage=storage)
    upload(harness, 3)
    storage.refusal = errno.ENOSPC  # Full storage can still remove
    harness.request(mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 0), "MISSION_ACK")
    assert held(harness).count == 0
    assert held(MavlinkHarness(storage=storage)).count == 0


@pytest.mark.parametrize("kind", range(3))
@pytest.mark.parametrize(
    "damage",
    [
        lambda contents: contents[:-10],
        lambda contents: contents[:20] + bytes([contents[20] ^ 4]) + contents[21:],
        lambda _contents: b"",
        lambda _contents: b"{}",
    ],
    ids=["truncated", "damaged", "empty", "another file"],
)
def test_a_damaged_plan_file_is_reported_and_ignored(kind: int, damage: Any) -> None:
    storage = MemoryStorage()
    harness = MavlinkHarness(storage=storage)
    for each in range(3):
        upload(harness, 3, each)
    storage.files[FILES[kind]] = damage(storage.files[FILES[kind]])
    again = MavlinkHarness(storage=storage)
    assert f"{FILES[kind]} is not used" in texts(again)
    assert [held(again, each).count for each in range(3)] == [
        0 if each == kind else 3 for each in range(3)
    ]
    assert upload(again, 2, kind).type == ACCEPTED
    assert held(MavlinkHarness(storage=storage), kind).count == 2


def test_unreadable_storage_is_reported_and_leaves_no_plan() -> None:
    class Unreadable(MemoryStorage):
        def load(self, name: str) -> bytes | None:
            raise OSError(errno.EIO, "Input/output error", name)

    harness = MavlinkHarness(storage=Unreadable())
    assert held(harness).count == 0
    assert "mission.plan is not used: Input/output error" in texts(
        MavlinkHarness(storage=Unreadable())
    )


def test_a_stored_plan_that_fails_the_check_is_not_used() -> None:
    storage = MemoryStorage()
    upload(MavlinkHarness(storage=storage), 3)
    stricter = MavlinkHarness(
        storage=storage, check=lambda _: MissionRejection(1, 3, "cannot be flown")
    )
    assert held(stricter).count == 0
    assert "mission.plan is not used: item 1: cannot be flown" in texts(
        MavlinkHarness(storage=storage, check=lambda _: MissionRejection(1, 3, "cannot be flown"))
    )


@pytest.mark.parametrize(
    ("refusal", "result"),
    [(errno.ENOSPC, NO_SPACE), (errno.EDQUOT, NO_SPACE), (errno.EIO, ERROR), (errno.EROFS, ERROR)],
)
def test_a_storage_error_keeps_the_previous_plan(refusal: int, result: int) -> None:
    storage = MemoryStorage()
    harness = MavlinkHarness(storage=storage)
    upload(harness, 3)
    before, storage.refusal = dict(storage.files), refusal
    harness.received()
    harness.send(mission_count(1))
    harness.send(mission_item(0))
    harness.run()
    received = harness.received()
    assert [m.type for m in received if m.get_type() == "MISSION_ACK"] == [result]
    assert "not saved" in "".join(m.text for m in received if m.get_type() == "STATUSTEXT")
    assert held(harness).count == 3
    assert harness.topics.mission.value is not None
    assert len(harness.topics.mission.value.items) == 3
    assert storage.files == before
    storage.refusal = None
    assert upload(harness, 1).type == ACCEPTED


def test_a_refused_plan_is_not_stored() -> None:
    storage = MemoryStorage()
    harness = MavlinkHarness(storage=storage, check=lambda _: MissionRejection(0, 5, "no"))
    assert upload(harness, 2).type == 5
    assert storage.files == {}
