"""Which frames and posts are changes."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dst.faults import changes
from dst.faults.changes import Change
from mavlink_broker.edge.outbox import Post
from tests.support import spooled_posts

CODEC = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)


def command(number: int, first: float = 0.0) -> bytes:
    values = (first, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    message = mavlink.MAVLink_command_long_message(1, 1, number, 0, *values)
    return bytes(message.pack(CODEC))


def packed(message: mavlink.MAVLink_message) -> bytes:
    return bytes(message.pack(CODEC))


@pytest.mark.parametrize(
    ("frame", "change"),
    [
        (command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0), Change.ARMING),
        (command(mavlink.MAV_CMD_MISSION_START), Change.START),
        (command(mavlink.MAV_CMD_DO_SET_MODE, 1.0), Change.START),
        (command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE), Change.PAUSE),
        (command(mavlink.MAV_CMD_REQUEST_MESSAGE, 242.0), None),
        (packed(mavlink.MAVLink_set_mode_message(1, 1, 4)), Change.START),
        (packed(mavlink.MAVLink_mission_count_message(1, 1, 3)), Change.UPLOAD),
        (packed(mavlink.MAVLink_mission_ack_message(255, 190, 0)), Change.UPLOAD),
        (packed(mavlink.MAVLink_mission_item_reached_message(2)), Change.WAYPOINT),
        (packed(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)), None),
        (b"", None),
        (b"\xfd\x09", None),
        (command(mavlink.MAV_CMD_MISSION_START)[:20], None),
    ],
)
def test_a_frame_is_read_by_what_it_orders_or_reports(frame: bytes, change: Change | None) -> None:
    assert changes.of_frame(frame) is change


def answer(status: str) -> Post:
    body = {"status": status}
    return spooled_posts.post(path="/broker/commands/16/ack", body=body)


@pytest.mark.parametrize(
    ("post", "status", "change"),
    [
        (answer("accepted"), 200, Change.ACCEPTANCE),
        (answer("done"), 200, Change.REPORT),
        (answer("accepted"), 409, None),
        (spooled_posts.post(body={"mission_status_id": 3}), 201, Change.REPORT),
        (spooled_posts.post(body={"mission_status_id": 3}), 503, None),
        (spooled_posts.state_vector(), 201, None),
    ],
)
def test_a_post_counts_when_it_was_taken(post: Post, status: int, change: Change | None) -> None:
    assert changes.of_post(post, status) is change
