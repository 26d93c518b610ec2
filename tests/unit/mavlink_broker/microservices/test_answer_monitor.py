"""Whether a vehicle that is received answers."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.mavlink.dialect import Message, Route, mavlink
from mavlink_broker.microservices.link_state import (
    ASKED_AGAIN_AFTER_S,
    ASKED_EVERY_S,
    LONGEST_PAUSE_S,
    UNANSWERED_AFTER_S,
    AnswerMonitor,
)

ROUTE = Route(254, 1, 1, 1)
TICK_S = 0.1
Answer = Callable[[Message], list[Message]]


def by_timesync(request: Message) -> list[Message]:
    """Answer with own time."""
    return [mavlink.MAVLink_timesync_message(777, request.ts1)]


def by_nothing(request: Message) -> list[Message]:
    """Receive nothing."""
    del request
    return []


def by_acknowledgement(request: Message) -> list[Message]:
    """Answer commands only; one arrives from time to time."""
    del request
    return [mavlink.MAVLink_command_ack_message(512, 0, 0, 0, 254, 1)]


def run(
    monitor: AnswerMonitor, start: float, seconds: float, answer: Answer = by_nothing
) -> list[float]:
    """Step a monitor; returns when it sent a request."""
    sent_at = []
    for number in range(round(seconds / TICK_S)):
        now = start + number * TICK_S
        for request in monitor.tick(now):
            assert request.get_type() == "TIMESYNC"
            assert request.tc1 == 0
            sent_at.append(now)
            for message in answer(request):
                monitor.receive(message)
    return sent_at


def test_a_vehicle_that_answers_is_asked_from_time_to_time() -> None:
    monitor = AnswerMonitor(ROUTE)
    sent_at = run(monitor, 0.0, 60.0, by_timesync)
    assert not monitor.is_unanswered
    assert len(sent_at) == pytest.approx(60.0 / ASKED_EVERY_S, abs=2)


def test_one_that_never_answered_is_found_and_asked_on() -> None:
    monitor = AnswerMonitor(ROUTE)
    run(monitor, 0.0, UNANSWERED_AFTER_S - 0.5)
    assert not monitor.is_unanswered
    run(monitor, UNANSWERED_AFTER_S - 0.5, 1.0)
    later = run(monitor, UNANSWERED_AFTER_S + 0.5, 20.0)
    assert len(later) == pytest.approx(20.0 / ASKED_AGAIN_AFTER_S, abs=1)
    assert monitor.is_unanswered


def test_one_that_ceases_to_answer_is_found_and_its_next_answer_counts() -> None:
    monitor = AnswerMonitor(ROUTE)
    run(monitor, 0.0, 30.0, by_timesync)
    run(monitor, 30.0, ASKED_EVERY_S + UNANSWERED_AFTER_S + 0.5)
    assert monitor.is_unanswered
    run(monitor, 42.5, 2.0, by_timesync)
    assert not monitor.is_unanswered


def test_a_late_answer_to_an_earlier_request_counts() -> None:
    """A satellite link answers after seconds."""
    monitor = AnswerMonitor(ROUTE)
    requests: list[Message] = []

    def later(request: Message) -> list[Message]:
        requests.append(request)
        return []

    run(monitor, 0.0, 6.0, later)
    monitor.receive(*by_timesync(requests[0]))
    run(monitor, 6.0, UNANSWERED_AFTER_S - 1.0)
    assert not monitor.is_unanswered


@given(st.integers(0, 2**62), st.integers(0, 2**62))
def test_the_answer_to_another_system_and_a_request_of_its_own_do_not_count(
    its_time: int, foreign: int
) -> None:
    monitor = AnswerMonitor(ROUTE)
    now = 1.0e6  # The broker's ts1 are above this; the others below
    foreign %= 10**15

    def answer(request: Message) -> list[Message]:
        return [
            mavlink.MAVLink_timesync_message(its_time or 1, foreign),
            mavlink.MAVLink_timesync_message(0, request.ts1),
            mavlink.MAVLink_command_ack_message(512, 0, 0, 0, 255, 190),
        ]

    run(monitor, now, UNANSWERED_AFTER_S + 1.0, answer)
    assert monitor.is_unanswered


def test_one_that_answers_commands_alone_has_no_timesync_and_is_asked_no_more() -> None:
    monitor = AnswerMonitor(ROUTE)
    run(monitor, 0.0, 5.0, by_acknowledgement)
    run(monitor, 5.0, UNANSWERED_AFTER_S + 5.0)
    assert not monitor.is_unanswered
    assert run(monitor, 20.0, 60.0) == []


def test_an_answer_that_overtakes_the_first_one_to_timesync_does_not_show_that_it_lacks_it() -> (
    None
):
    """A slow link that dies after two seconds."""
    monitor = AnswerMonitor(ROUTE)
    run(monitor, 0.0, 2.0, by_acknowledgement)
    run(monitor, 2.0, UNANSWERED_AFTER_S + 1.0)
    assert monitor.is_unanswered


def test_the_time_without_an_answer_goes_on_behind_an_outage() -> None:
    """A link of one direction that loses heartbeats for a while, again and again."""
    before = AnswerMonitor(ROUTE)
    run(before, 0.0, 6.0)
    monitor = AnswerMonitor(ROUTE, before.unanswered_s(6.0))
    run(monitor, 20.0, UNANSWERED_AFTER_S - 6.5)
    assert not monitor.is_unanswered
    run(monitor, 20.0 + UNANSWERED_AFTER_S - 6.5, 1.0)
    assert monitor.unanswered_s(30.0) >= UNANSWERED_AFTER_S
    run(monitor, 30.0, 1.0, by_timesync)
    assert monitor.unanswered_s(40.0) == 0.0


def test_a_broker_that_stood_still_does_not_count_that_time() -> None:
    monitor = AnswerMonitor(ROUTE)
    run(monitor, 0.0, 9.0)
    run(monitor, 9.0 + 100.0 * LONGEST_PAUSE_S, 2.0)
    assert not monitor.is_unanswered
