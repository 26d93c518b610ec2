"""A state that arrives behind a newer one of its kind shows what the vehicle has left."""

from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.link_state import BEHIND_IN_A_ROW, SEQUENCE_GAP_S, StateOrder


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
    order = StateOrder()
    for number in range(600):
        assert not order.is_overtaken(heartbeat(number), 0.02 * number)


def test_a_heartbeat_behind_a_newer_one_is_overtaken() -> None:
    order = StateOrder()
    assert not order.is_overtaken(heartbeat(250), 1.0)
    assert not order.is_overtaken(heartbeat(260), 1.3)
    assert order.is_overtaken(heartbeat(255), 1.4)
    assert order.is_overtaken(heartbeat(250), 1.5)
    assert not order.is_overtaken(heartbeat(261), 1.6)


def test_a_heartbeat_behind_other_frames_counts() -> None:
    order = StateOrder()
    assert not order.is_overtaken(heartbeat(1), 1.0)
    assert not order.is_overtaken(other(20), 1.3)
    assert not order.is_overtaken(heartbeat(10), 1.4)
    assert order.is_overtaken(heartbeat(9), 1.5)


def test_a_vehicle_that_was_restarted_counts_anew() -> None:
    order = StateOrder()
    assert not order.is_overtaken(heartbeat(100), 1.0)
    assert not order.is_overtaken(heartbeat(0), 1.0 + SEQUENCE_GAP_S + 0.1)
    assert not order.is_overtaken(heartbeat(1), 1.0 + SEQUENCE_GAP_S + 0.2)


@given(st.integers(0, 255), st.integers(0, 255))
def test_a_link_with_other_numbers_is_followed_after_few_frames(old: int, new: int) -> None:
    """PX4 and ArduPilot number the frames of each link."""
    order = StateOrder()
    for count in range(20):
        order.is_overtaken(heartbeat(old + count), 0.02 * count)
    overtaken = [
        order.is_overtaken(heartbeat(new + count), 0.4 + 0.02 * count) for count in range(200)
    ]
    assert sum(overtaken) < BEHIND_IN_A_ROW
    assert not any(overtaken[BEHIND_IN_A_ROW:])


def test_a_frame_that_arrives_twice_counts_once_more() -> None:
    order = StateOrder()
    assert not order.is_overtaken(heartbeat(5), 1.0)
    assert not order.is_overtaken(heartbeat(5), 1.1)


def test_a_complete_mission_behind_the_next_one_is_overtaken() -> None:
    order = StateOrder()
    complete = mavlink.MAVLink_mission_current_message(3, 4, mavlink.MISSION_STATE_COMPLETE)
    begun = mavlink.MAVLink_mission_current_message(0, 5, mavlink.MISSION_STATE_ACTIVE)
    assert not order.is_overtaken(numbered(begun, 11), 1.0)
    assert order.is_overtaken(numbered(complete, 10), 1.01)
    assert not order.is_overtaken(numbered(begun, 12), 1.02)


def test_each_kind_of_state_has_an_order_of_its_own() -> None:
    order = StateOrder()
    on_ground = mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_ON_GROUND)
    assert not order.is_overtaken(heartbeat(11), 1.0)
    assert not order.is_overtaken(numbered(on_ground, 10), 1.01)
    assert order.is_overtaken(heartbeat(9), 1.02)
    assert order.is_overtaken(numbered(on_ground, 8), 1.03)


def test_what_a_vehicle_reports_once_counts_however_late_it_is() -> None:
    order = StateOrder()
    assert not order.is_overtaken(
        numbered(mavlink.MAVLink_mission_item_reached_message(2), 11), 1.0
    )
    assert not order.is_overtaken(
        numbered(mavlink.MAVLink_mission_item_reached_message(1), 10), 1.01
    )
