"""When a gateway connects, gives up and reconnects; the replies of its records."""

import itertools
import re
from random import Random

import pytest

from edge_server.outbox.answers import Outcome, classify
from edge_server.outbox.retry import Backoff
from edge_server.transitions import IllegalTransitionError
from edge_server.uplinks import mqtt_session
from edge_server.uplinks.mqtt_protocol import Limits, RecordPacket
from edge_server.uplinks.mqtt_session import (
    LEAST_SUSPECT_BYTES,
    LINK_STATES,
    STRIKES,
    Accepted,
    Acknowledged,
    Action,
    Announce,
    Answered,
    Cut,
    Event,
    LinkState,
    LinkTrigger,
    Lost,
    Open,
    Publish,
    Refused,
    Session,
    Subscribe,
    Subscribed,
)
from tests.support import pages

CAP_S = 10.0
REFUSED_WAIT_S = 60.0
CONNECT_S = 5.0
ANSWER_S = 15.0


def session() -> Session:
    return Session(
        backoff=Backoff(1.0, CAP_S),
        refused_wait_s=REFUSED_WAIT_S,
        connect_timeout_s=CONNECT_S,
        answer_timeout_s=ANSWER_S,
        random=Random(1),
    )


def record(key: str = "1", order_key: str = "pose/1") -> RecordPacket:
    return RecordPacket(key, order_key, order_key, b"{}", "application/json", "answers")


def connect(gateway: Session, now: float = 0.0) -> None:
    assert gateway.step(now) == [Open()]
    gateway.opened(now)
    assert gateway.handle(Accepted(Limits()), now) == [Subscribe()]
    assert gateway.handle(Subscribed(1, "granted"), now) == [Announce()]
    assert gateway.state is LinkState.UP


def outcomes(gateway: Session) -> dict[str, Outcome]:
    return {key: classify(reply).outcome for key, reply in gateway.take_settled()}


def test_it_connects_by_itself_and_sends_once_it_is_subscribed() -> None:
    gateway = session()
    gateway.submit(record(), 0.0)
    assert gateway.step(0.0) == [Open()]
    gateway.opened(0.0)
    assert gateway.step(0.0) == []
    gateway.handle(Accepted(Limits()), 0.0)
    assert gateway.step(0.0) == []
    gateway.handle(Subscribed(0, "granted"), 0.0)
    assert gateway.step(0.0) == [Publish(record())]


@pytest.mark.parametrize("accepted", [False, True])
def test_a_broker_that_does_not_answer_times_out(*, accepted: bool) -> None:
    gateway = session()
    gateway.submit(record(), 0.0)
    gateway.step(0.0)
    gateway.opened(1.0)
    if accepted:
        gateway.handle(Accepted(Limits()), 2.0)
    assert gateway.next_step_at(2.0) == 1.0 + CONNECT_S
    assert gateway.step(0.9 + CONNECT_S) == []
    assert gateway.step(1.0 + CONNECT_S) == [Cut()]
    assert gateway.state is LinkState.DOWN
    assert outcomes(gateway) == {"1": Outcome.NO_CLOUD}


def test_idle_it_reconnects_after_growing_waits_up_to_the_cap() -> None:
    gateway, now, waits = session(), 0.0, []
    for _ in range(40):
        assert gateway.step(now) == [Open()]
        gateway.handle(Lost("refused"), now)
        waits.append(gateway.next_step_at(now) - now)
        assert gateway.step(now + waits[-1] * 0.99) == []
        now += waits[-1]
    assert max(waits) <= CAP_S
    assert max(waits[6:]) > 1.0
    assert len(set(waits)) == len(waits)  # Jitter


def test_a_submitted_record_makes_it_connect_at_once() -> None:
    gateway = session()
    gateway.step(0.0)
    gateway.handle(Refused(0x86, "bad user name or password"), 0.0)
    assert gateway.step(1.0) == []
    gateway.submit(record(), 1.0)
    assert gateway.step(1.0) == [Open()]


def test_without_records_it_waits_long_after_a_refusal() -> None:
    gateway = session()
    gateway.step(0.0)
    assert gateway.handle(Refused(0x87, "not authorized"), 0.0) == [Cut()]
    assert gateway.next_step_at(0.0) == REFUSED_WAIT_S


@pytest.mark.parametrize(
    ("event", "outcome"),
    [
        (Refused(0x86, "bad user name or password"), Outcome.NO_ACCESS),
        (Refused(0x89, "busy"), Outcome.NO_CLOUD),
        (Lost("reset"), Outcome.NO_CLOUD),
    ],
)
def test_records_get_the_reason_why_there_is_no_connection(event: Event, outcome: Outcome) -> None:
    gateway = session()
    gateway.submit(record("1"), 0.0)
    gateway.submit(record("2", "alarm/1"), 0.0)
    gateway.step(0.0)
    gateway.handle(event, 0.0)
    assert outcomes(gateway) == {"1": outcome, "2": outcome}
    assert gateway.fault


def test_a_refused_subscription_is_no_access() -> None:
    gateway = session()
    gateway.submit(record(), 0.0)
    gateway.step(0.0)
    gateway.opened(0.0)
    gateway.handle(Accepted(Limits()), 0.0)
    assert gateway.handle(Subscribed(0x87, "not authorized"), 0.0) == [Cut()]
    assert outcomes(gateway) == {"1": Outcome.NO_ACCESS}


def test_waits_grow_while_connections_break_at_once() -> None:
    gateway, now, waits = session(), 0.0, []
    for _ in range(20):
        connect(gateway, now)
        gateway.handle(Lost("taken over", 0x8E), now)
        waits.append(gateway.next_step_at(now) - now)
        now += waits[-1]
    assert max(waits[5:]) > 2.0
    connect(gateway, now)
    gateway.handle(Lost("restarted"), now + CAP_S)
    assert gateway.next_step_at(now + CAP_S) - (now + CAP_S) <= 1.0


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
def test_an_event_after_the_end_of_the_connection_is_ignored(late: Event) -> None:
    gateway = session()
    connect(gateway)
    gateway.handle(Lost("cut"), 1.0)
    before = gateway.next_step_at(1.0)
    nothing: list[Action] = []
    assert gateway.handle(late, 1.0) == nothing
    assert (gateway.state, gateway.next_step_at(1.0)) == (LinkState.DOWN, before)


@pytest.mark.parametrize("connected", [True, False])
def test_a_record_in_flight_gets_a_reason_at_the_end(*, connected: bool) -> None:
    gateway = session()
    if connected:
        connect(gateway)
    gateway.submit(record(), 1.0)
    if connected:
        gateway.step(1.0)
    gateway.close(2.0)
    assert outcomes(gateway) == {"1": Outcome.NO_CLOUD}


def replies_to_protocol_errors(sent: RecordPacket, times: int) -> list[Outcome]:
    """Meanings of a record that is sent again and again, and each time the connection ends so."""
    gateway, now, found = session(), 0.0, []
    for _ in range(times):
        connect(gateway, now)
        gateway.submit(sent, now)
        gateway.step(now)
        gateway.sent(sent.key, 1, now)
        gateway.handle(Lost("no MQTT", 0x82), now)
        found += list(outcomes(gateway).values())
        now += CAP_S
    return found


def test_a_packet_is_rejected_after_repeated_protocol_errors() -> None:
    large = record()._replace(payload=b"x" * LEAST_SUSPECT_BYTES)
    found = replies_to_protocol_errors(large, STRIKES)
    assert found == [Outcome.NO_CLOUD] * (STRIKES - 1) + [Outcome.REJECTED]


def test_a_small_record_is_never_rejected_for_a_broken_connection() -> None:
    found = replies_to_protocol_errors(record(), 5 * STRIKES)
    assert found == [Outcome.NO_CLOUD] * 5 * STRIKES


def test_a_packet_that_the_broker_calls_too_large_is_rejected_at_once() -> None:
    gateway = session()
    connect(gateway)
    gateway.submit(record(), 0.0)
    gateway.step(0.0)
    gateway.sent("1", 1, 0.0)
    gateway.handle(Lost("too large", 0x95), 0.0)
    assert outcomes(gateway) == {"1": Outcome.REJECTED}


DRAWN = re.compile(r"^ +(\w+) --> (\w+): (.+)$", re.MULTILINE)


@pytest.mark.parametrize(("state", "trigger"), list(itertools.product(LinkState, LinkTrigger)))
def test_a_transition_that_is_not_in_the_table_is_illegal(
    state: LinkState, trigger: LinkTrigger
) -> None:
    following = LINK_STATES.transitions.get((state, trigger))
    assert LINK_STATES.get(state, trigger) is following
    if following is None:
        with pytest.raises(IllegalTransitionError):
            LINK_STATES.follow(state, trigger)


def test_every_state_but_down_can_lose_the_connection() -> None:
    for state in set(LinkState) - {LinkState.DOWN}:
        assert LINK_STATES.follow(state, LinkTrigger.LOST) is LinkState.DOWN


def test_the_diagrams_are_the_table() -> None:
    table = {
        (state.name, following.name, trigger.value)
        for (state, trigger), following in LINK_STATES.transitions.items()
    }
    for text in (mqtt_session.__doc__ or "", pages.text("reference/cloud-mqtt.md")):
        assert set(DRAWN.findall(text)) == table
