"""Downloads of a plan while another peer replaces it."""

from typing import Any, Final

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import (
    BROKER,
    GROUND,
    SYSTEM,
    MavlinkHarness,
    mission_count,
    mission_item,
)
from uav_firmware.modules.mavlink.missions.downloads import SILENT_US
from uav_firmware.modules.mavlink.wire.dialect import mavlink

MISSION: Final = 0
CANCELLED: Final = mavlink.MAV_MISSION_OPERATION_CANCELLED


def upload(harness: MavlinkHarness, count: int, system: int = 254) -> None:
    """Store a plan by the other peer; plans of other lengths are other plans."""
    for message in (mission_count(count), *(mission_item(seq) for seq in range(count))):
        harness.send(message, source=BROKER, system=system)
        harness.run()
    assert harness.received("MISSION_ACK", at=BROKER)[-1].type == mavlink.MAV_MISSION_ACCEPTED


def begin_download(harness: MavlinkHarness) -> None:
    (count,) = harness.request(
        mavlink.MAVLink_mission_request_list_message(SYSTEM, 1, MISSION), "MISSION_COUNT"
    )
    assert count.count == 3
    assert answer(harness, 0).seq == 0


def answer(harness: MavlinkHarness, seq: int) -> Any:
    """MISSION_ITEM_INT or MISSION_ACK to a request of the peer that downloads."""
    harness.received()
    harness.send(mavlink.MAVLink_mission_request_int_message(SYSTEM, 1, seq, MISSION))
    harness.run()
    (answered,) = (
        message
        for message in harness.received(at=GROUND)
        if message.get_type() in {"MISSION_ITEM_INT", "MISSION_ACK"}
    )
    return answered


@pytest.mark.parametrize("system", [254, 255], ids=["other ids", "same ids"])
def test_a_download_holds_no_items_of_two_plans(system: int) -> None:
    harness = MavlinkHarness()
    upload(harness, 3)
    begin_download(harness)
    upload(harness, 5, system)
    assert answer(harness, 1).type == CANCELLED
    assert answer(harness, 2).type == CANCELLED
    harness.run()
    harness.send(mavlink.MAVLink_mission_request_list_message(SYSTEM, 1, MISSION))
    harness.run()
    assert answer(harness, 4).seq == 4


def test_the_reason_is_given_once() -> None:
    harness = MavlinkHarness()
    upload(harness, 3)
    begin_download(harness)
    upload(harness, 5)
    harness.received()
    for seq in (1, 2):
        harness.send(mavlink.MAVLink_mission_request_int_message(SYSTEM, 1, seq, MISSION))
        harness.run()
    texts = [message.text for message in harness.received("STATUSTEXT") if message.text]
    assert "".join(texts).count("another plan has been stored since") == 1


def test_the_same_plan_stored_again_ends_no_download() -> None:
    harness = MavlinkHarness()
    upload(harness, 3)
    begin_download(harness)
    upload(harness, 3)
    assert answer(harness, 1).seq == 1


@pytest.mark.parametrize("way", ["acknowledged", "silent"])
def test_a_download_that_has_ended_refuses_nothing(way: str) -> None:
    harness = MavlinkHarness()
    upload(harness, 3)
    begin_download(harness)
    if way == "acknowledged":
        harness.send(mavlink.MAVLink_mission_ack_message(SYSTEM, 1, 0, MISSION))
        harness.run()
    else:
        harness.run(SILENT_US + 1_000_000)
    upload(harness, 5)
    assert answer(harness, 4).seq == 4
