"""One of several links to a vehicle is active, and changes no more often than necessary."""

from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.links.url import Address
from mavlink_broker.routing.link_selection import (
    ADDRESSES_KEPT,
    SILENT_AFTER_S,
    STEADY_AFTER_S,
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
