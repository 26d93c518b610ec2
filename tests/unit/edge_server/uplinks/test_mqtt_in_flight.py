"""Records in flight, against a small model: each settled once, one per order key at a time."""

from collections import defaultdict
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from edge_server.outbox.answers import Answer, Outcome, Reply, Unreachable, classify
from edge_server.uplinks.mqtt_in_flight import InFlight
from edge_server.uplinks.mqtt_protocol import Limits, RecordPacket

TIMEOUT_S = 10.0
LIMITS = Limits(receive_maximum=2, packet_bytes=400)
OK = b'{"status": 200}'


def packet(
    key: str, order_key: str = "pose/1", size: int = 10, answers: str | None = "a"
) -> RecordPacket:
    return RecordPacket(key, order_key, order_key, b"x" * size, "application/json", answers)


def started(limits: Limits = LIMITS) -> InFlight:
    in_flight = InFlight(timeout_s=TIMEOUT_S)
    in_flight.begin(limits)
    return in_flight


def send(in_flight: InFlight, now: float = 0.0) -> list[str]:
    """Send what may go, under packet identifiers from the keys."""
    taken = in_flight.take(now)
    for each in taken:
        in_flight.sent(each.key, int(each.key), now)
    return [each.key for each in taken]


def replies(in_flight: InFlight) -> dict[str, Reply]:
    return dict(in_flight.take_settled())


def outcomes(in_flight: InFlight) -> dict[str, Outcome]:
    return {key: classify(reply).outcome for key, reply in in_flight.take_settled()}


def test_an_acknowledgement_of_the_broker_does_not_confirm() -> None:
    in_flight = started()
    in_flight.submit(packet("1"), 0.0)
    assert send(in_flight) == ["1"]
    in_flight.acknowledged(1, 0, 1.0)
    assert replies(in_flight) == {}
    in_flight.answered(b"1", OK, 1.0)
    assert outcomes(in_flight) == {"1": Outcome.CONFIRMED}


def test_an_acknowledgement_confirms_if_no_answer_is_requested() -> None:
    in_flight = started()
    in_flight.submit(packet("1", answers=None), 0.0)
    send(in_flight)
    in_flight.acknowledged(1, 0, 1.0)
    assert outcomes(in_flight) == {"1": Outcome.CONFIRMED}


def test_a_record_is_sent_after_its_predecessor_is_settled() -> None:
    in_flight = started()
    for key in ("1", "2", "3"):
        in_flight.submit(packet(key), 0.0)
    assert send(in_flight) == ["1"]
    assert send(in_flight) == []
    in_flight.answered(b"1", b'{"status": 422}', 1.0)
    assert send(in_flight) == ["2"]
    in_flight.answered(b"2", b'{"status": 503}', 1.0)
    assert send(in_flight) == []
    found = outcomes(in_flight)
    assert found == {"1": Outcome.REJECTED, "2": Outcome.TRY_LATER, "3": Outcome.HELD_BACK}
    assert in_flight.idle


def test_no_more_are_sent_than_the_broker_accepts() -> None:
    in_flight = started()
    for key in ("1", "2", "3"):
        in_flight.submit(packet(key, order_key=f"pose/{key}"), 0.0)
    assert send(in_flight) == ["1", "2"]
    in_flight.answered(b"1", OK, 1.0)
    assert send(in_flight) == []  # Its acknowledgement is what makes room
    in_flight.acknowledged(1, 0, 1.0)
    assert send(in_flight) == ["3"]


def test_our_presence_counts_against_the_receive_maximum() -> None:
    in_flight = started(Limits(receive_maximum=1))
    in_flight.sent_other(77)
    in_flight.submit(packet("1"), 0.0)
    assert send(in_flight) == []
    in_flight.acknowledged(77, 0, 0.0)
    assert send(in_flight) == ["1"]


def test_a_packet_that_is_too_large_for_the_broker_is_not_sent() -> None:
    in_flight = started()
    in_flight.submit(packet("1", size=500), 0.0)
    in_flight.submit(packet("2"), 0.0)
    assert send(in_flight) == ["2"]
    assert outcomes(in_flight) == {"1": Outcome.REJECTED}


def test_the_largest_packet_is_taken_for_the_one_that_was_too_large() -> None:
    in_flight = started()
    in_flight.submit(packet("1", "pose/1"), 0.0)
    in_flight.submit(packet("2", "image/1", size=200), 0.0)
    in_flight.submit(packet("3", "image/1"), 0.0)
    send(in_flight)
    in_flight.connection_lost(Unreachable("closed"), 1.0, too_large=True)
    assert outcomes(in_flight) == {
        "1": Outcome.NO_CLOUD,
        "2": Outcome.REJECTED,
        "3": Outcome.NO_CLOUD,
    }
    assert in_flight.idle
    in_flight.begin(LIMITS)
    assert send(in_flight) == []


def test_a_record_times_out_and_a_late_answer_is_ignored() -> None:
    in_flight = started()
    in_flight.submit(packet("1"), 0.0)
    send(in_flight)
    in_flight.tick(TIMEOUT_S - 0.1)
    assert replies(in_flight) == {}
    assert in_flight.next_deadline() == TIMEOUT_S
    in_flight.tick(TIMEOUT_S)
    assert outcomes(in_flight) == {"1": Outcome.NO_CLOUD}
    in_flight.answered(b"1", OK, TIMEOUT_S + 1.0)
    assert replies(in_flight) == {}


def test_a_broker_that_accepts_one_at_a_time_causes_no_timeout() -> None:
    in_flight, now = started(Limits(receive_maximum=1)), 0.0
    keys = [str(number) for number in range(1, 8)]
    for key in keys:
        in_flight.submit(packet(key, order_key=key), now)
    for key in keys:
        assert send(in_flight, now) == [key]
        now += TIMEOUT_S * 0.8
        in_flight.tick(now)
        in_flight.acknowledged(int(key), 0, now)
        in_flight.answered(key.encode(), OK, now)
    assert set(outcomes(in_flight).values()) == {Outcome.CONFIRMED}


def test_records_time_out_while_nothing_can_be_sent() -> None:
    in_flight = started(Limits(receive_maximum=1))
    in_flight.submit(packet("1", order_key="a"), 0.0)
    in_flight.submit(packet("2", order_key="b"), 0.0)
    send(in_flight)
    in_flight.tick(TIMEOUT_S)
    assert outcomes(in_flight) == {"1": Outcome.NO_CLOUD, "2": Outcome.NO_CLOUD}


def test_a_late_acknowledgement_of_an_earlier_attempt_is_ignored() -> None:
    in_flight = started()
    in_flight.submit(packet("1", answers=None), 0.0)
    in_flight.take(0.0)
    in_flight.sent("1", 100, 0.0)
    in_flight.tick(TIMEOUT_S)
    in_flight.submit(packet("1", answers=None), TIMEOUT_S)
    assert [each.key for each in in_flight.take(TIMEOUT_S)] == ["1"]
    in_flight.sent("1", 101, TIMEOUT_S)
    in_flight.take_settled()
    in_flight.acknowledged(100, 0x97, TIMEOUT_S)
    assert replies(in_flight) == {}
    in_flight.acknowledged(101, 0, TIMEOUT_S)
    assert outcomes(in_flight) == {"1": Outcome.CONFIRMED}


class Traffic(RuleBasedStateMachine):
    """Offers, answers good and bad, refusals, silence, cuts."""

    def __init__(self) -> None:
        super().__init__()
        self._in_flight = started()
        self._now = 0.0
        self._number = 0
        self._submitted: dict[str, list[str]] = defaultdict(list)  # By order_key
        self._sent: dict[str, list[str]] = defaultdict(list)
        self._replies: dict[str, Reply] = {}
        self._order_key_of: dict[str, str] = {}
        self._acknowledgements: set[int] = set()

    def _take(self) -> None:
        self._collect()
        for each in self._in_flight.take(self._now):
            self._in_flight.sent(each.key, int(each.key), self._now)
            self._acknowledgements.add(int(each.key))
            assert not self._flying(each.order_key), "two of one order key at a time"
            self._sent[each.order_key].append(each.key)
        self._collect()

    def _collect(self) -> None:
        for key, reply in self._in_flight.take_settled():
            assert key not in self._replies, "settled twice"
            self._replies[key] = reply

    def _flying(self, order_key: str) -> list[str]:
        return [key for key in self._sent[order_key] if key not in self._replies]

    def _all_flying(self) -> list[str]:
        return [key for order_key in list(self._sent) for key in self._flying(order_key)]

    @rule(order_key=st.sampled_from("abc"), size=st.sampled_from([10, 10, 500]))
    def submit(self, order_key: str, size: int) -> None:
        self._number += 1
        key = str(self._number)
        self._order_key_of[key] = order_key
        self._submitted[order_key].append(key)
        self._in_flight.submit(packet(key, order_key, size), self._now)
        self._take()

    @precondition(lambda self: self._all_flying())
    @rule(
        data=st.data(), payload=st.sampled_from([OK, b'{"status": 422}', b'{"status": 503}', b""])
    )
    def answer(self, data: Any, payload: bytes) -> None:
        key = data.draw(st.sampled_from(self._all_flying()))
        self._in_flight.answered(key.encode(), payload, self._now)
        self._take()

    @precondition(lambda self: self._acknowledgements)
    @rule(data=st.data(), code=st.sampled_from([0, 0, 0x10, 0x87, 0x97, 0x99]))
    def acknowledge(self, data: Any, code: int) -> None:
        number = data.draw(st.sampled_from(sorted(self._acknowledgements)))
        self._acknowledgements.discard(number)
        self._in_flight.acknowledged(number, code, self._now)
        self._take()

    @rule(key=st.integers(0, 30), payload=st.binary(max_size=20))
    def strange_answer(self, key: int, payload: bytes) -> None:
        if str(key) not in self._all_flying():
            self._in_flight.answered(str(key).encode() + b"\xff" * (key % 2), payload, self._now)
            self._take()

    @rule(seconds=st.floats(0.0, 12.0))
    def wait(self, seconds: float) -> None:
        self._now += seconds
        self._in_flight.tick(self._now)
        self._take()

    @rule(too_large=st.booleans())
    def cut(self, *, too_large: bool) -> None:
        self._in_flight.connection_lost(Unreachable("cut"), self._now, too_large=too_large)
        self._acknowledgements.clear()
        self._in_flight.begin(LIMITS)
        self._take()
        assert self._in_flight.idle

    @invariant()
    def the_broker_is_never_given_more_than_it_takes(self) -> None:
        assert len(self._acknowledgements) <= LIMITS.receive_maximum

    @invariant()
    def an_order_key_is_sent_in_the_order_of_its_offers(self) -> None:
        for order_key, sent in self._sent.items():
            assert sent == [key for key in self._submitted[order_key] if key in sent]

    @invariant()
    def nothing_waits_for_ever(self) -> None:
        open_keys = [key for key in self._order_key_of if key not in self._replies]
        assert self._in_flight.idle == (not open_keys)
        if open_keys:
            deadline = self._in_flight.next_deadline()
            assert deadline is not None
            assert deadline <= self._now + TIMEOUT_S

    @invariant()
    def only_an_answer_confirms(self) -> None:
        for key, reply in self._replies.items():
            if isinstance(reply, Answer) and reply.status == 200:
                assert reply.body == OK
                assert key in self._sent[self._order_key_of[key]]


TestTraffic = Traffic.TestCase
TestTraffic.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
