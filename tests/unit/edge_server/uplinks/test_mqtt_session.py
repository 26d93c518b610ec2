"""When a gateway connects, gives up, tries again; what records hear of it."""

from random import Random

import pytest

from edge_server.outbox.answers import Meaning, judge
from edge_server.outbox.retry import Backoff
from edge_server.uplinks.mqtt_messages import (
    Accepted,
    Acknowledged,
    Action,
    Announce,
    Answered,
    Cut,
    Event,
    Limits,
    Lost,
    Open,
    Publish,
    RecordPacket,
    Refused,
    Subscribe,
    Subscribed,
)
from edge_server.uplinks.mqtt_session import LEAST_SUSPECT_BYTES, STRIKES, Session
from edge_server.uplinks.mqtt_states import LinkState

CAP_S = 10.0
REFUSED_WAIT_S = 60.0
CONNECT_S = 5.0
ANSWER_S = 15.0


def session() -> Session:
    return Session(
        backoff=Backoff(1.0, CAP_S),
        refused_wait_s=REFUSED_WAIT_S,
        connect_patience_s=CONNECT_S,
        answer_patience_s=ANSWER_S,
        random=Random(1),
    )


def record(key: str = "1", lane: str = "pose/1") -> RecordPacket:
    return RecordPacket(key, lane, lane, b"{}", "application/json", "answers")


def connect(gateway: Session, now: float = 0.0) -> None:
    assert gateway.turn(now) == [Open()]
    gateway.opened(now)
    assert gateway.handle(Accepted(Limits()), now) == [Subscribe()]
    assert gateway.handle(Subscribed(1, "granted"), now) == [Announce()]
    assert gateway.state is LinkState.UP


def meanings(gateway: Session) -> dict[str, Meaning]:
    return {key: judge(reply).meaning for key, reply in gateway.settled()}


def test_it_connects_by_itself_and_sends_only_when_answers_can_be_heard() -> None:
    gateway = session()
    gateway.offer(record(), 0.0)
    assert gateway.turn(0.0) == [Open()]
    gateway.opened(0.0)
    assert gateway.turn(0.0) == []
    gateway.handle(Accepted(Limits()), 0.0)
    assert gateway.turn(0.0) == []
    gateway.handle(Subscribed(0, "granted"), 0.0)
    assert gateway.turn(0.0) == [Publish(record())]


@pytest.mark.parametrize("accepted", [False, True])
def test_a_broker_that_says_nothing_is_given_up(*, accepted: bool) -> None:
    gateway = session()
    gateway.offer(record(), 0.0)
    gateway.turn(0.0)
    gateway.opened(1.0)
    if accepted:
        gateway.handle(Accepted(Limits()), 2.0)
    assert gateway.wake_at(2.0) == 1.0 + CONNECT_S
    assert gateway.turn(0.9 + CONNECT_S) == []
    assert gateway.turn(1.0 + CONNECT_S) == [Cut()]
    assert gateway.state is LinkState.DOWN
    assert meanings(gateway) == {"1": Meaning.NO_CLOUD}


def test_idle_it_tries_again_later_and_later_but_never_later_than_the_cap() -> None:
    gateway, now, waits = session(), 0.0, []
    for _ in range(40):
        assert gateway.turn(now) == [Open()]
        gateway.handle(Lost("refused"), now)
        waits.append(gateway.wake_at(now) - now)
        assert gateway.turn(now + waits[-1] * 0.99) == []
        now += waits[-1]
    assert max(waits) <= CAP_S
    assert max(waits[6:]) > 1.0
    assert len(set(waits)) == len(waits)  # Jitter


def test_a_record_that_is_to_go_is_a_reason_to_try_at_once() -> None:
    gateway = session()
    gateway.turn(0.0)
    gateway.handle(Refused(0x86, "bad user name or password"), 0.0)
    assert gateway.turn(1.0) == []
    gateway.offer(record(), 1.0)
    assert gateway.turn(1.0) == [Open()]


def test_without_records_a_refusal_is_not_tested_often() -> None:
    gateway = session()
    gateway.turn(0.0)
    assert gateway.handle(Refused(0x87, "not authorized"), 0.0) == [Cut()]
    assert gateway.wake_at(0.0) == REFUSED_WAIT_S


@pytest.mark.parametrize(
    ("event", "meaning"),
    [
        (Refused(0x86, "bad user name or password"), Meaning.NO_ACCESS),
        (Refused(0x89, "busy"), Meaning.NO_CLOUD),
        (Lost("reset"), Meaning.NO_CLOUD),
    ],
)
def test_records_hear_why_there_is_no_connection(event: Event, meaning: Meaning) -> None:
    gateway = session()
    gateway.offer(record("1"), 0.0)
    gateway.offer(record("2", "alarm/1"), 0.0)
    gateway.turn(0.0)
    gateway.handle(event, 0.0)
    assert meanings(gateway) == {"1": meaning, "2": meaning}
    assert gateway.trouble


def test_answers_that_may_not_be_heard_are_no_access() -> None:
    gateway = session()
    gateway.offer(record(), 0.0)
    gateway.turn(0.0)
    gateway.opened(0.0)
    gateway.handle(Accepted(Limits()), 0.0)
    assert gateway.handle(Subscribed(0x87, "not authorized"), 0.0) == [Cut()]
    assert meanings(gateway) == {"1": Meaning.NO_ACCESS}


def test_a_connection_that_breaks_at_once_over_and_over_is_not_hurried() -> None:
    gateway, now, waits = session(), 0.0, []
    for _ in range(20):
        connect(gateway, now)
        gateway.handle(Lost("taken over", 0x8E), now)
        waits.append(gateway.wake_at(now) - now)
        now += waits[-1]
    assert max(waits[5:]) > 2.0
    connect(gateway, now)
    gateway.handle(Lost("restarted"), now + CAP_S)
    assert gateway.wake_at(now + CAP_S) - (now + CAP_S) <= 1.0


@pytest.mark.parametrize(
    "late",
    [
        Acknowledged(1, 0),
        Answered(b"1", b'{"status": 200}'),
        Accepted(Limits()),
        Subscribed(0, ""),
        Lost("old"),
    ],
)
def test_what_comes_too_late_changes_nothing(late: Event) -> None:
    gateway = session()
    connect(gateway)
    gateway.handle(Lost("cut"), 1.0)
    before = gateway.wake_at(1.0)
    nothing: list[Action] = []
    assert gateway.handle(late, 1.0) == nothing
    assert (gateway.state, gateway.wake_at(1.0)) == (LinkState.DOWN, before)


@pytest.mark.parametrize("connected", [True, False])
def test_what_is_under_way_when_we_leave_gets_a_reason(*, connected: bool) -> None:
    gateway = session()
    if connected:
        connect(gateway)
    gateway.offer(record(), 1.0)
    if connected:
        gateway.turn(1.0)
    gateway.close(2.0)
    assert meanings(gateway) == {"1": Meaning.NO_CLOUD}


def replies_to_protocol_errors(sent: RecordPacket, times: int) -> list[Meaning]:
    """Meanings of a record that is sent again and again, and each time the connection ends so."""
    gateway, now, found = session(), 0.0, []
    for _ in range(times):
        connect(gateway, now)
        gateway.offer(sent, now)
        gateway.turn(now)
        gateway.sent(sent.key, 1, now)
        gateway.handle(Lost("no MQTT", 0x82), now)
        found += list(meanings(gateway).values())
        now += CAP_S
    return found


def test_a_broker_that_names_no_culprit_is_believed_after_a_few_times() -> None:
    large = record()._replace(payload=b"x" * LEAST_SUSPECT_BYTES)
    found = replies_to_protocol_errors(large, STRIKES)
    assert found == [Meaning.NO_CLOUD] * (STRIKES - 1) + [Meaning.REJECTED]


def test_a_small_record_is_never_the_reason_of_a_broken_connection() -> None:
    found = replies_to_protocol_errors(record(), 5 * STRIKES)
    assert found == [Meaning.NO_CLOUD] * 5 * STRIKES


def test_a_broker_that_names_a_culprit_is_believed_at_once() -> None:
    gateway = session()
    connect(gateway)
    gateway.offer(record(), 0.0)
    gateway.turn(0.0)
    gateway.sent("1", 1, 0.0)
    gateway.handle(Lost("too large", 0x95), 0.0)
    assert meanings(gateway) == {"1": Meaning.REJECTED}
