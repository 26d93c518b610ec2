"""A heartbeat that arrives behind a newer one shows a mode that the vehicle has left."""

from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.heartbeat import SEQUENCE_GAP_S, HeartbeatOrder


def numbered(message: Message, number: int) -> Message:
    codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    codec.seq = number % 256
    frame = message.pack(codec)
    [decoded] = mavlink.MAVLink(None).parse_buffer(frame)
    return decoded


def heartbeat(number: int) -> Message:
    return numbered(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3), number)


def other(number: int) -> Message:
    return numbered(mavlink.MAVLink_attitude_message(0, *[0.0] * 6), number)


def test_heartbeats_in_their_order_count() -> None:
    order = HeartbeatOrder()
    for number in range(600):
        assert not order.is_overtaken(heartbeat(number), 0.02 * number)


def test_a_heartbeat_behind_a_newer_one_is_overtaken() -> None:
    order = HeartbeatOrder()
    assert not order.is_overtaken(heartbeat(250), 1.0)
    assert not order.is_overtaken(heartbeat(260), 1.3)
    assert order.is_overtaken(heartbeat(255), 1.4)
    assert order.is_overtaken(heartbeat(250), 1.5)
    assert not order.is_overtaken(heartbeat(261), 1.6)


def test_a_heartbeat_behind_other_frames_counts() -> None:
    order = HeartbeatOrder()
    assert not order.is_overtaken(heartbeat(1), 1.0)
    assert not order.is_overtaken(other(20), 1.3)
    assert not order.is_overtaken(heartbeat(10), 1.4)
    assert order.is_overtaken(heartbeat(9), 1.5)


def test_a_vehicle_that_was_restarted_counts_anew() -> None:
    order = HeartbeatOrder()
    assert not order.is_overtaken(heartbeat(100), 1.0)
    assert not order.is_overtaken(heartbeat(0), 1.0 + SEQUENCE_GAP_S + 0.1)
    assert not order.is_overtaken(heartbeat(1), 1.0 + SEQUENCE_GAP_S + 0.2)


def test_a_frame_that_arrives_twice_counts_once_more() -> None:
    order = HeartbeatOrder()
    assert not order.is_overtaken(heartbeat(5), 1.0)
    assert not order.is_overtaken(heartbeat(5), 1.1)
