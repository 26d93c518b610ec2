"""Plans over a restart of the vehicle: kept whole, or not used, and never a crash."""

import errno
from typing import Any

import pytest

from tests.support.memory_storage import MemoryStorage
from tests.unit.uav_firmware.modules.mavlink.harness import (
    SYSTEM,
    Bench,
    mission_count,
    mission_item,
)
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.mission import MissionRejection

ACCEPTED, ERROR, NO_SPACE = 0, 1, 4
FILES = ("mission.plan", "geofence.plan", "rally.plan")


def upload(bench: Bench, count: int, mission_type: int = 0, **fields: Any) -> Any:
    bench.hear()
    bench.say(mission_count(count, mission_type))
    for seq in range(count):
        bench.say(mission_item(seq, mission_type=mission_type, **fields))
    bench.run()
    (ack,) = bench.hear("MISSION_ACK")
    return ack


def held(bench: Bench, mission_type: int = 0) -> Any:
    message = mavlink.MAVLink_mission_request_list_message(SYSTEM, 1, mission_type)
    (count,) = bench.ask(message, "MISSION_COUNT")
    return count


def texts(bench: Bench) -> str:
    bench.run()
    return "".join(m.text for m in bench.hear("STATUSTEXT"))


def test_every_plan_and_its_id_outlive_a_restart() -> None:
    storage = MemoryStorage()
    bench = Bench(storage=storage)
    acks = [upload(bench, 3 + kind, kind, z=20.0 + kind) for kind in range(3)]
    again = Bench(storage=storage)
    for kind, ack in enumerate(acks):
        count = held(again, kind)
        assert (count.count, count.opaque_id) == (3 + kind, ack.opaque_id)
        topic = (again.topics.mission, again.topics.fence, again.topics.rally_points)[kind]
        assert topic.value is not None
        assert [item.z for item in topic.value.items] == [20.0 + kind] * (3 + kind)
    assert texts(again) == ""


def test_a_mission_from_before_the_restart_begins_at_its_first_item() -> None:
    storage = MemoryStorage()
    upload(Bench(storage=storage), 4)
    again = Bench(storage=storage)
    again.run(1_100_000)
    told = again.hear("MISSION_CURRENT")[-1]
    assert (told.seq, told.total, told.mission_state) == (0, 4, 2)


def test_a_removed_plan_stays_removed() -> None:
    storage = MemoryStorage()
    bench = Bench(storage=storage)
    upload(bench, 3)
    storage.refusal = errno.ENOSPC  # a full medium can still forget
    bench.ask(mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 0), "MISSION_ACK")
    assert held(bench).count == 0
    assert held(Bench(storage=storage)).count == 0


@pytest.mark.parametrize("kind", range(3))
@pytest.mark.parametrize(
    "damage",
    [
        lambda contents: contents[:-10],
        lambda contents: contents[:20] + bytes([contents[20] ^ 4]) + contents[21:],
        lambda _contents: b"",
        lambda _contents: b"{}",
    ],
    ids=["cut off", "damaged", "empty", "another file"],
)
def test_a_damaged_file_means_no_plan_and_a_text(kind: int, damage: Any) -> None:
    storage = MemoryStorage()
    bench = Bench(storage=storage)
    for each in range(3):
        upload(bench, 3, each)
    storage.files[FILES[kind]] = damage(storage.files[FILES[kind]])
    again = Bench(storage=storage)
    assert f"{FILES[kind]} is not used" in texts(again)
    assert [held(again, each).count for each in range(3)] == [
        0 if each == kind else 3 for each in range(3)
    ]
    assert upload(again, 2, kind).type == ACCEPTED
    assert held(Bench(storage=storage), kind).count == 2


def test_a_medium_that_cannot_be_read_means_no_plan_and_a_text() -> None:
    class Unreadable(MemoryStorage):
        def load(self, name: str) -> bytes | None:
            raise OSError(errno.EIO, "Input/output error", name)

    bench = Bench(storage=Unreadable())
    assert held(bench).count == 0
    assert "mission.plan is not used: Input/output error" in texts(Bench(storage=Unreadable()))


def test_a_stored_plan_that_the_judges_refuse_is_not_used() -> None:
    storage = MemoryStorage()
    upload(Bench(storage=storage), 3)
    stricter = Bench(storage=storage, check=lambda _: MissionRejection(1, 3, "cannot be flown"))
    assert held(stricter).count == 0
    assert "mission.plan is not used: item 1: cannot be flown" in texts(
        Bench(storage=storage, check=lambda _: MissionRejection(1, 3, "cannot be flown"))
    )


@pytest.mark.parametrize(
    ("refusal", "result"),
    [(errno.ENOSPC, NO_SPACE), (errno.EDQUOT, NO_SPACE), (errno.EIO, ERROR), (errno.EROFS, ERROR)],
)
def test_a_medium_that_refuses_keeps_the_old_plan(refusal: int, result: int) -> None:
    storage = MemoryStorage()
    bench = Bench(storage=storage)
    upload(bench, 3)
    before, storage.refusal = dict(storage.files), refusal
    bench.hear()
    bench.say(mission_count(1))
    bench.say(mission_item(0))
    bench.run()
    heard = bench.hear()
    assert [m.type for m in heard if m.get_type() == "MISSION_ACK"] == [result]
    assert "not saved" in "".join(m.text for m in heard if m.get_type() == "STATUSTEXT")
    assert held(bench).count == 3
    assert bench.topics.mission.value is not None
    assert len(bench.topics.mission.value.items) == 3
    assert storage.files == before
    storage.refusal = None
    assert upload(bench, 1).type == ACCEPTED


def test_a_refused_plan_does_not_reach_the_medium() -> None:
    storage = MemoryStorage()
    bench = Bench(storage=storage, check=lambda _: MissionRejection(0, 5, "no"))
    assert upload(bench, 2).type == 5
    assert storage.files == {}
