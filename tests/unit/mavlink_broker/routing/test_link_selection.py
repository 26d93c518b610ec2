"""The active link of a vehicle, and a second vehicle with the same system id."""

from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.links.url import Address
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.routing.link_selection import (
    ADDRESSES_KEPT,
    SILENT_AFTER_S,
    STEADY_AFTER_S,
    DuplicateSystemIds,
    LinkSelection,
)

WIFI = Address("192.0.2.1", 14581, 0)
RADIO = Address("/dev/ttyUSB0", 57600, 1)
OTHER_PORT = Address("192.0.2.1", 20000, 0)


def test_the_first_link_is_active() -> None:
    selection = LinkSelection()
    assert selection.is_silent(0.0)
    assert selection.receive(RADIO, 0.0)
    assert selection.active == RADIO


def test_messages_on_two_links_count_once() -> None:
    selection = LinkSelection()
    counted = [selection.receive(address, 0.2 * n) for n in range(100) for address in (WIFI, RADIO)]
    assert counted == [True, False] * 100


def test_a_silent_link_is_replaced_by_one_that_is_received() -> None:
    selection = LinkSelection()
    selection.receive(WIFI, 0.0)
    assert not selection.receive(RADIO, SILENT_AFTER_S * 0.9)
    assert selection.receive(RADIO, SILENT_AFTER_S * 1.1)
    assert selection.active == RADIO


def test_an_earlier_link_takes_over_once_it_is_steady() -> None:
    selection = LinkSelection()
    selection.receive(RADIO, 0.0)
    changed_at = None
    for n in range(100):
        now = 0.1 * n
        selection.receive(RADIO, now)
        if selection.receive(WIFI, now):
            changed_at = changed_at or now
    assert changed_at is not None
    assert STEADY_AFTER_S <= changed_at < STEADY_AFTER_S + 0.2
    assert selection.active == WIFI


def test_an_earlier_link_with_gaps_does_not_take_over() -> None:
    selection = LinkSelection()
    for n in range(200):
        selection.receive(RADIO, 0.1 * n)
        if n % 20 == 0:
            assert not selection.receive(WIFI, 0.1 * n)


def test_a_later_link_never_replaces_one_that_is_received() -> None:
    selection = LinkSelection()
    for n in range(300):
        assert selection.receive(WIFI, 0.1 * n)
        assert not selection.receive(RADIO, 0.1 * n)


def test_a_vehicle_that_returns_from_another_port_is_answered_there() -> None:
    selection = LinkSelection()
    selection.receive(WIFI, 0.0)
    assert selection.receive(OTHER_PORT, 10.0)
    assert selection.active == OTHER_PORT


@given(st.lists(st.tuples(st.integers(0, 40), st.floats(0.0, 3.0)), max_size=80))
def test_the_number_of_addresses_is_bounded(arrivals: list[tuple[int, float]]) -> None:
    selection, now = LinkSelection(), 0.0
    for port, pause_s in arrivals:
        now += pause_s
        counts = selection.receive(Address("192.0.2.1", port), now)
        assert counts == (selection.active == Address("192.0.2.1", port))
        assert not selection.is_silent(now) or not counts
    assert len(selection._receptions) <= ADDRESSES_KEPT


HERE = Address("192.0.2.1", 14581)
THERE = Address("192.0.2.9", 14581)
ELSEWHERE = Address("192.0.2.20", 14581)


def attitude(boot_s: float) -> Message:
    return received_from_1(mavlink.MAVLink_attitude_message(int(boot_s * 1e3), 0, 0, 0, 0, 0, 0))


def heartbeat() -> Message:
    return received_from_1(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))


def received_from_1(message: Message) -> Message:
    (decoded,) = Decoder().decode(Encoder(1, 1).encode(message))
    return decoded


def received(behind_s: float, seconds: int = 10) -> tuple[DuplicateSystemIds, list[bool]]:
    """Two links, on the second of which the clock is behind by so much."""
    twins, reported = DuplicateSystemIds(), []
    for second in range(seconds):
        twins.receive_active(attitude(100.0 + second), HERE, float(second))
        reported.append(
            twins.receive_other(attitude(100.1 + second - behind_s), THERE, second + 0.1)
        )
    return twins, reported


def test_the_same_clock_on_both_links_is_one_vehicle() -> None:
    for behind_s in (0.0, 1.5, 5.0):
        twins, reported = received(behind_s)
        assert not any(reported)
        assert twins.warning(1, 10.0) is None


def test_another_clock_is_another_vehicle_and_reported_once() -> None:
    twins, reported = received(40.0)
    assert reported.count(True) == 1
    assert twins.warning(1, 10.0) == (
        "another vehicle at 192.0.2.9:14581 has the same system id, 1"
    )
    assert twins.warning(2, 10.0) is None


def test_a_warning_ends_when_the_other_falls_silent() -> None:
    twins, _ = received(40.0)
    assert twins.warning(1, 60.0) is None


def test_a_forgotten_system_has_no_warning() -> None:
    twins, _ = received(40.0)
    twins.forget(1)
    assert twins.warning(1, 10.0) is None
    assert not twins.receive_other(attitude(3.0), THERE, 10.0)


def test_one_without_a_clock_is_the_same_once_it_is_received_for_as_long_as_a_clock_takes() -> None:
    """However long the first one has been silent: its clock follows its first heartbeat."""
    twins, _ = received(0.0)
    assert not twins.is_same(heartbeat(), ELSEWHERE, 100.0)
    assert not twins.is_same(heartbeat(), ELSEWHERE, 102.9)
    assert twins.is_same(heartbeat(), ELSEWHERE, 103.0)


def test_its_first_clock_shows_on_the_active_link_that_it_is_another() -> None:
    for boot_s, is_another in ((500.0, True), (150.0, True), (204.0, False), (3.0, False)):
        twins, _ = received(0.0)
        twins.is_same(heartbeat(), ELSEWHERE, 100.0)
        assert not twins.receive_active(heartbeat(), ELSEWHERE, 103.0)
        assert twins.receive_active(attitude(boot_s), ELSEWHERE, 104.0) is is_another
        assert not twins.receive_active(attitude(boot_s + 0.1), ELSEWHERE, 104.1)


def test_the_time_of_a_picture_is_no_clock_of_its_vehicle() -> None:
    """It may be announced again, or be asked for, minutes after it was taken."""
    picture = received_from_1(
        mavlink.MAVLink_camera_image_captured_message(
            5_000, 0, 1, 0, 0, 0, 0, [1.0, 0.0, 0.0, 0.0], 7, 1, b""
        )
    )
    twins, _ = received(0.0)
    assert not twins.receive_active(picture, HERE, 10.0)
    assert twins.is_same(attitude(110.1), THERE, 10.1)
    twins.is_same(picture, THERE, 10.2)
    assert not twins.is_another(1, THERE)
    assert not any(twins.receive_other(picture, THERE, 10.3 + n) for n in range(5))
