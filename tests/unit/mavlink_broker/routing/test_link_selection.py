"""Of several ways to a vehicle one counts, and changes no more often than it must."""

from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.links.url import Address
from mavlink_broker.routing.link_selection import SILENT_AFTER_S, TRUSTED_AFTER_S, WAYS_KEPT, Ways

WIFI = Address("192.0.2.1", 14581, 0)
RADIO = Address("/dev/ttyUSB0", 57600, 1)
OTHER_PORT = Address("192.0.2.1", 20000, 0)


def test_the_first_way_counts() -> None:
    ways = Ways()
    assert ways.is_silent(0.0)
    assert ways.hear(RADIO, 0.0)
    assert ways.active == RADIO


def test_what_comes_by_two_ways_counts_once() -> None:
    ways = Ways()
    counted = [ways.hear(way, 0.2 * n) for n in range(100) for way in (WIFI, RADIO)]
    assert counted == [True, False] * 100


def test_a_way_that_falls_silent_is_left_for_one_that_is_heard() -> None:
    ways = Ways()
    ways.hear(WIFI, 0.0)
    assert not ways.hear(RADIO, SILENT_AFTER_S * 0.9)
    assert ways.hear(RADIO, SILENT_AFTER_S * 1.1)
    assert ways.active == RADIO


def test_an_earlier_link_takes_over_once_it_is_steady() -> None:
    ways = Ways()
    ways.hear(RADIO, 0.0)
    changed_at = None
    for n in range(100):
        now = 0.1 * n
        ways.hear(RADIO, now)
        if ways.hear(WIFI, now):
            changed_at = changed_at or now
    assert changed_at is not None
    assert TRUSTED_AFTER_S <= changed_at < TRUSTED_AFTER_S + 0.2
    assert ways.active == WIFI


def test_an_earlier_link_with_gaps_does_not_take_over() -> None:
    ways = Ways()
    for n in range(200):
        ways.hear(RADIO, 0.1 * n)
        if n % 20 == 0:
            assert not ways.hear(WIFI, 0.1 * n)


def test_a_later_link_never_takes_over_from_one_that_is_heard() -> None:
    ways = Ways()
    for n in range(300):
        assert ways.hear(WIFI, 0.1 * n)
        assert not ways.hear(RADIO, 0.1 * n)


def test_a_vehicle_that_comes_back_from_another_port_is_answered_there() -> None:
    ways = Ways()
    ways.hear(WIFI, 0.0)
    assert ways.hear(OTHER_PORT, 10.0)
    assert ways.active == OTHER_PORT


@given(st.lists(st.tuples(st.integers(0, 40), st.floats(0.0, 3.0)), max_size=80))
def test_any_number_of_ways_costs_no_more_than_a_few(said: list[tuple[int, float]]) -> None:
    ways, now = Ways(), 0.0
    for port, pause_s in said:
        now += pause_s
        counts = ways.hear(Address("192.0.2.1", port), now)
        assert counts == (ways.active == Address("192.0.2.1", port))
        assert not ways.is_silent(now) or not counts
    assert len(ways._hearings) <= WAYS_KEPT
