"""Records on their way, against a small model: each settled once, one of a lane at a time."""

from collections import defaultdict
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from edge_server.outbox.answers import Answer, Meaning, Reply, Unreachable, judge
from edge_server.uplinks.mqtt_exchange import Exchange
from edge_server.uplinks.mqtt_messages import Limits, RecordPacket

PATIENCE_S = 10.0
LIMITS = Limits(receive_maximum=2, packet_bytes=400)
OK = b'{"status": 200}'


def packet(
    key: str, lane: str = "pose/1", size: int = 10, answers: str | None = "a"
) -> RecordPacket:
    return RecordPacket(key, lane, lane, b"x" * size, "application/json", answers)


def started(limits: Limits = LIMITS) -> Exchange:
    exchange = Exchange(patience_s=PATIENCE_S)
    exchange.begin(limits)
    return exchange


def send(exchange: Exchange, now: float = 0.0) -> list[str]:
    """Send what may go, under packet identifiers from the keys."""
    taken = exchange.take(now)
    for each in taken:
        exchange.sent(each.key, int(each.key), now)
    return [each.key for each in taken]


def outcome(exchange: Exchange) -> dict[str, Reply]:
    return dict(exchange.settled())


def meanings(exchange: Exchange) -> dict[str, Meaning]:
    return {key: judge(reply).meaning for key, reply in exchange.settled()}


def test_the_brokers_word_is_not_the_clouds() -> None:
    exchange = started()
    exchange.offer(packet("1"), 0.0)
    assert send(exchange) == ["1"]
    exchange.acknowledged(1, 0, 1.0)
    assert outcome(exchange) == {}
    exchange.answered(b"1", OK, 1.0)
    assert meanings(exchange) == {"1": Meaning.CONFIRMED}


def test_the_brokers_word_is_enough_where_no_answer_is_asked_for() -> None:
    exchange = started()
    exchange.offer(packet("1", answers=None), 0.0)
    send(exchange)
    exchange.acknowledged(1, 0, 1.0)
    assert meanings(exchange) == {"1": Meaning.CONFIRMED}


def test_a_record_follows_its_predecessor_not_before_its_end() -> None:
    exchange = started()
    for key in ("1", "2", "3"):
        exchange.offer(packet(key), 0.0)
    assert send(exchange) == ["1"]
    assert send(exchange) == []
    exchange.answered(b"1", b'{"status": 422}', 1.0)
    assert send(exchange) == ["2"]
    exchange.answered(b"2", b'{"status": 503}', 1.0)
    assert send(exchange) == []
    found = meanings(exchange)
    assert found == {"1": Meaning.REJECTED, "2": Meaning.TRY_LATER, "3": Meaning.HELD_BACK}
    assert exchange.idle


def test_no_more_go_than_the_broker_takes() -> None:
    exchange = started()
    for key in ("1", "2", "3"):
        exchange.offer(packet(key, lane=f"pose/{key}"), 0.0)
    assert send(exchange) == ["1", "2"]
    exchange.answered(b"1", OK, 1.0)
    assert send(exchange) == []  # Its acknowledgement is what makes room
    exchange.acknowledged(1, 0, 1.0)
    assert send(exchange) == ["3"]


def test_our_presence_takes_room_at_the_broker_too() -> None:
    exchange = started(Limits(receive_maximum=1))
    exchange.occupied(77)
    exchange.offer(packet("1"), 0.0)
    assert send(exchange) == []
    exchange.acknowledged(77, 0, 0.0)
    assert send(exchange) == ["1"]


def test_what_is_larger_than_the_broker_takes_is_not_sent() -> None:
    exchange = started()
    exchange.offer(packet("1", size=500), 0.0)
    exchange.offer(packet("2"), 0.0)
    assert send(exchange) == ["2"]
    assert meanings(exchange) == {"1": Meaning.REJECTED}


def test_of_several_the_largest_was_too_large() -> None:
    exchange = started()
    exchange.offer(packet("1", "pose/1"), 0.0)
    exchange.offer(packet("2", "image/1", size=200), 0.0)
    exchange.offer(packet("3", "image/1"), 0.0)
    send(exchange)
    exchange.lost(Unreachable("closed"), 1.0, too_large=True)
    assert meanings(exchange) == {
        "1": Meaning.NO_CLOUD,
        "2": Meaning.REJECTED,
        "3": Meaning.NO_CLOUD,
    }
    assert exchange.idle
    exchange.begin(LIMITS)
    assert send(exchange) == []


def test_silence_ends_after_our_patience_and_a_late_answer_is_nobodys() -> None:
    exchange = started()
    exchange.offer(packet("1"), 0.0)
    send(exchange)
    exchange.tick(PATIENCE_S - 0.1)
    assert outcome(exchange) == {}
    assert exchange.next_deadline() == PATIENCE_S
    exchange.tick(PATIENCE_S)
    assert meanings(exchange) == {"1": Meaning.NO_CLOUD}
    exchange.answered(b"1", OK, PATIENCE_S + 1.0)
    assert outcome(exchange) == {}


def test_a_broker_that_takes_one_at_a_time_is_not_taken_for_a_dead_one() -> None:
    exchange, now = started(Limits(receive_maximum=1)), 0.0
    keys = [str(number) for number in range(1, 8)]
    for key in keys:
        exchange.offer(packet(key, lane=key), now)
    for key in keys:
        assert send(exchange, now) == [key]
        now += PATIENCE_S * 0.8
        exchange.tick(now)
        exchange.acknowledged(int(key), 0, now)
        exchange.answered(key.encode(), OK, now)
    assert set(meanings(exchange).values()) == {Meaning.CONFIRMED}


def test_what_cannot_be_sent_while_nothing_is_gets_a_reason() -> None:
    exchange = started(Limits(receive_maximum=1))
    exchange.offer(packet("1", lane="a"), 0.0)
    exchange.offer(packet("2", lane="b"), 0.0)
    send(exchange)
    exchange.tick(PATIENCE_S)
    assert meanings(exchange) == {"1": Meaning.NO_CLOUD, "2": Meaning.NO_CLOUD}


def test_the_late_acknowledgement_of_an_earlier_try_is_not_taken_for_this_one() -> None:
    exchange = started()
    exchange.offer(packet("1", answers=None), 0.0)
    exchange.take(0.0)
    exchange.sent("1", 100, 0.0)
    exchange.tick(PATIENCE_S)
    exchange.offer(packet("1", answers=None), PATIENCE_S)
    assert [each.key for each in exchange.take(PATIENCE_S)] == ["1"]
    exchange.sent("1", 101, PATIENCE_S)
    exchange.settled()
    exchange.acknowledged(100, 0x97, PATIENCE_S)
    assert outcome(exchange) == {}
    exchange.acknowledged(101, 0, PATIENCE_S)
    assert meanings(exchange) == {"1": Meaning.CONFIRMED}


class Traffic(RuleBasedStateMachine):
    """Offers, answers good and bad, refusals, silence, cuts."""

    def __init__(self) -> None:
        super().__init__()
        self._exchange = started()
        self._now = 0.0
        self._number = 0
        self._offered: dict[str, list[str]] = defaultdict(list)  # By lane
        self._sent: dict[str, list[str]] = defaultdict(list)
        self._replies: dict[str, Reply] = {}
        self._lane_of: dict[str, str] = {}
        self._acknowledgements: set[int] = set()

    def _take(self) -> None:
        self._collect()
        for each in self._exchange.take(self._now):
            self._exchange.sent(each.key, int(each.key), self._now)
            self._acknowledgements.add(int(each.key))
            assert not self._flying(each.lane), "two of a lane at a time"
            self._sent[each.lane].append(each.key)
        self._collect()

    def _collect(self) -> None:
        for key, reply in self._exchange.settled():
            assert key not in self._replies, "settled twice"
            self._replies[key] = reply

    def _flying(self, lane: str) -> list[str]:
        return [key for key in self._sent[lane] if key not in self._replies]

    def _all_flying(self) -> list[str]:
        return [key for lane in list(self._sent) for key in self._flying(lane)]

    @rule(lane=st.sampled_from("abc"), size=st.sampled_from([10, 10, 500]))
    def offer(self, lane: str, size: int) -> None:
        self._number += 1
        key = str(self._number)
        self._lane_of[key] = lane
        self._offered[lane].append(key)
        self._exchange.offer(packet(key, lane, size), self._now)
        self._take()

    @precondition(lambda self: self._all_flying())
    @rule(
        data=st.data(), payload=st.sampled_from([OK, b'{"status": 422}', b'{"status": 503}', b""])
    )
    def answer(self, data: Any, payload: bytes) -> None:
        key = data.draw(st.sampled_from(self._all_flying()))
        self._exchange.answered(key.encode(), payload, self._now)
        self._take()

    @precondition(lambda self: self._acknowledgements)
    @rule(data=st.data(), code=st.sampled_from([0, 0, 0x10, 0x87, 0x97, 0x99]))
    def acknowledge(self, data: Any, code: int) -> None:
        number = data.draw(st.sampled_from(sorted(self._acknowledgements)))
        self._acknowledgements.discard(number)
        self._exchange.acknowledged(number, code, self._now)
        self._take()

    @rule(key=st.integers(0, 30), payload=st.binary(max_size=20))
    def strange_answer(self, key: int, payload: bytes) -> None:
        if str(key) not in self._all_flying():
            self._exchange.answered(str(key).encode() + b"\xff" * (key % 2), payload, self._now)
            self._take()

    @rule(seconds=st.floats(0.0, 12.0))
    def wait(self, seconds: float) -> None:
        self._now += seconds
        self._exchange.tick(self._now)
        self._take()

    @rule(too_large=st.booleans())
    def cut(self, *, too_large: bool) -> None:
        self._exchange.lost(Unreachable("cut"), self._now, too_large=too_large)
        self._acknowledgements.clear()
        self._exchange.begin(LIMITS)
        self._take()
        assert self._exchange.idle

    @invariant()
    def the_broker_is_never_given_more_than_it_takes(self) -> None:
        assert len(self._acknowledgements) <= LIMITS.receive_maximum

    @invariant()
    def a_lane_is_sent_in_the_order_of_its_offers(self) -> None:
        for lane, sent in self._sent.items():
            assert sent == [key for key in self._offered[lane] if key in sent]

    @invariant()
    def nothing_waits_for_ever(self) -> None:
        open_keys = [key for key in self._lane_of if key not in self._replies]
        assert self._exchange.idle == (not open_keys)
        if open_keys:
            deadline = self._exchange.next_deadline()
            assert deadline is not None
            assert deadline <= self._now + PATIENCE_S

    @invariant()
    def only_an_answer_confirms(self) -> None:
        for key, reply in self._replies.items():
            if isinstance(reply, Answer) and reply.status == 200:
                assert reply.body == OK
                assert key in self._sent[self._lane_of[key]]


TestTraffic = Traffic.TestCase
TestTraffic.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
