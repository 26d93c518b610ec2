"""The link to a vehicle: heartbeats, reboots, round trips, late states and silent sources."""

import random

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, is_vehicle, mavlink
from mavlink_broker.microservices.command import (
    FIRST_TIMEOUT_S,
    LONGEST_TIMEOUT_S,
    SHORTEST_TIMEOUT_S,
    RoundTrip,
)
from mavlink_broker.microservices.link_state import (
    BEHIND_IN_A_ROW,
    COPIED_WITHIN_S,
    MAX_TIMEOUT_S,
    MIN_TIMEOUT_S,
    SEQUENCE_GAP_S,
    FrameLoss,
    LinkMonitor,
    LinkState,
    OwnHeartbeat,
    PeriodicSource,
    RebootMonitor,
    StateOrder,
)
from tests.unit.mavlink_broker.microservices.harness import tick_until


def test_our_heartbeat_is_sent_once_a_second_as_an_onboard_controller() -> None:
    sent = tick_until(OwnHeartbeat(), 0.0, 10.0)
    assert len(sent) == 10
    assert {message.type for message in sent} == {mavlink.MAV_TYPE_ONBOARD_CONTROLLER}
    assert not is_vehicle(sent[0])


@pytest.mark.parametrize(
    ("age", "state"),
    [
        (0.0, LinkState.CONNECTED),
        (1.9, LinkState.CONNECTED),
        (2.1, LinkState.STALE),
        (4.9, LinkState.STALE),
        (5.1, LinkState.LOST),
    ],
)
def test_the_link_state_follows_the_age_of_the_heartbeat(age: float, state: LinkState) -> None:
    watch = LinkMonitor()
    watch.heartbeat_received(100.0)
    assert watch.state(100.0 + age) is state


def test_a_vehicle_without_a_heartbeat_is_lost() -> None:
    assert LinkMonitor().state(0.0) is LinkState.LOST


def feed(watch: RebootMonitor, *times_ms: int, start_s: float = 0.0, kind: str = "ATTITUDE") -> int:
    """Give times five times a second; how many restarts they prove."""
    restarts = [watch.sample(kind, ms, start_s + 0.2 * i) for i, ms in enumerate(times_ms)]
    return restarts.count(True)


class TestARestart:
    @given(st.integers(5_000, 2**31), st.integers(0, 1_000))
    def test_is_a_clock_that_restarts_and_is_reported_once(self, before: int, after: int) -> None:
        assert feed(RebootMonitor(), before, *(after + 200 * i for i in range(10))) == 1

    def test_soon_after_the_one_before_is_seen_too(self) -> None:
        watch = RebootMonitor()
        assert feed(watch, *range(0, 4_000, 200)) == 0
        assert feed(watch, *range(100, 3_000, 200), start_s=9.0) == 1

    def test_in_a_silence_shows_by_any_step_back(self) -> None:
        """50 s old, out of reach for 45 s of which it needed 5 s to restart: 40 s old."""
        watch = RebootMonitor()
        assert feed(watch, *range(45_000, 50_000, 200)) == 0
        assert feed(watch, *range(40_000, 42_000, 200), start_s=50.0) == 1

    @pytest.mark.parametrize("speed", [0.1, 1.0, 40.0])
    def test_shows_at_any_speed_of_a_simulated_clock(self, speed: float) -> None:
        watch = RebootMonitor()
        step = round(200 * speed)
        assert feed(watch, *(100_000 + step * i for i in range(50))) == 0
        assert feed(watch, *(step * i for i in range(50)), start_s=10.0) == 1

    def test_shows_in_each_kind_of_message_and_is_reported_once(self) -> None:
        watch = RebootMonitor()
        kinds = ("ATTITUDE", "GLOBAL_POSITION_INT", "SYSTEM_TIME")
        restarts = 0
        for index in range(100):
            boot_ms = 60_000 + 200 * index if index < 50 else 200 * (index - 50)
            restarts += sum(watch.sample(kind, boot_ms, 0.2 * index) for kind in kinds)
        assert restarts == 1


class TestNoRestart:
    @given(st.lists(st.integers(0, 900), max_size=50))
    def test_are_frames_that_overtake_one_another(self, late_ms: list[int]) -> None:
        times = [10_000 + 200 * index - late for index, late in enumerate(late_ms)]
        assert feed(RebootMonitor(), *times) == 0

    def test_is_one_very_late_frame(self) -> None:
        assert feed(RebootMonitor(), 60_000, 10_000, 60_200, 10_200, 60_400) == 0

    def test_are_some_seconds_that_a_modem_kept_back(self) -> None:
        watch = RebootMonitor()
        kept_back = range(95_000, 100_000, 200)
        assert feed(watch, 100_000, *kept_back, 100_200, 100_400) == 0

    def test_is_the_end_of_the_counter(self) -> None:
        end = 2**32
        times = [(end - 2_000 + 200 * i) % end for i in range(50)]
        assert feed(RebootMonitor(), *times) == 0

    def test_are_clocks_that_differ_from_message_to_message(self) -> None:
        watch = RebootMonitor()
        for index in range(100):
            assert not watch.sample("ATTITUDE", 60_000 + 200 * index, 0.2 * index)
            assert not watch.sample("SYSTEM_TIME", 200 * index, 0.2 * index)


@given(st.lists(st.floats(0.0, 60.0), min_size=1, max_size=40))
def test_timeouts_stay_within_what_links_do(samples: list[float]) -> None:
    round_trip = RoundTrip()
    for sample in samples:
        round_trip.sample(sample)
        assert SHORTEST_TIMEOUT_S <= round_trip.timeout_s <= LONGEST_TIMEOUT_S


def test_a_fast_link_has_short_timeouts_and_a_slow_one_long_ones() -> None:
    timeouts = []
    for delay in (0.01, 0.4, 1.5):
        round_trip = RoundTrip()
        assert round_trip.timeout_s == FIRST_TIMEOUT_S
        for _ in range(20):
            round_trip.sample(delay)
        timeouts.append(round_trip.timeout_s)
        assert round_trip.timeout_s > delay
    assert timeouts == sorted(timeouts)


def test_a_link_slower_than_the_first_guess_is_learnt_all_the_same() -> None:
    """Every request is repeated before its answer comes, and no answer names its request."""
    round_trip = RoundTrip()
    round_trip.sample_repeated(1.5)
    assert round_trip.timeout_s == FIRST_TIMEOUT_S, "one may have been lost"
    round_trip.sample_repeated(1.5)
    assert round_trip.timeout_s > 1.5


def test_a_lost_answer_now_and_then_does_not_slow_a_fast_link_down() -> None:
    round_trip = RoundTrip()
    for index in range(40):
        if index % 3:
            round_trip.sample(0.01)
        else:
            round_trip.sample_repeated(0.4)
    assert round_trip.timeout_s == SHORTEST_TIMEOUT_S


def received_over(loss: float, frames: int = 4000, seed: int = 1) -> FrameLoss:
    encoder, decoder, chance = Encoder(1, 1), Decoder(), random.Random(seed)
    link = FrameLoss()
    for _ in range(frames):
        frame = encoder.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))
        if chance.random() >= loss:
            for message in decoder.decode(frame):
                link.take(message)
    return link


@pytest.mark.parametrize("loss", [0.0, 0.05, 0.2, 0.5])
def test_the_share_of_lost_frames_is_found(loss: float) -> None:
    assert received_over(loss).ratio == pytest.approx(loss, abs=0.06)


def test_repeated_and_late_frames_are_not_lost() -> None:
    encoder, link = Encoder(1, 1), FrameLoss()
    frames = [encoder.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)) for _ in "12345"]
    for number in (0, 1, 1, 2, 3, 2, 4):
        (message,) = Decoder().decode(frames[number])
        link.take(message)
    assert link.ratio == 0.0


def regular_source(times: int, every_s: float) -> PeriodicSource:
    periodic = PeriodicSource(0.0)
    for number in range(1, times):
        periodic.received(number * every_s)
    return periodic


def silent_after(periodic: PeriodicSource, loss: float = 0.0) -> float:
    """How long it must have been silent."""
    return next(
        tenth / 10
        for tenth in range(2000)
        if periodic.is_silent(periodic.received_at + tenth / 10, loss)
    )


def test_five_seconds_are_silence_where_nothing_is_lost() -> None:
    assert silent_after(regular_source(10, 1.0)) == MIN_TIMEOUT_S


def test_the_more_is_lost_the_longer_it_takes_but_not_for_ever() -> None:
    patience = [silent_after(regular_source(10, 1.0), loss) for loss in (0.05, 0.2, 0.4, 0.8)]
    assert patience == sorted(patience)
    assert 8.0 < patience[1] < 10.0
    assert patience[-1] == MAX_TIMEOUT_S


def test_a_longer_interval_has_a_longer_timeout() -> None:
    assert silent_after(regular_source(5, 10.0)) == pytest.approx(30.0)


def test_two_messages_do_not_make_a_periodic_source() -> None:
    assert not regular_source(2, 1.0).is_silent(1000.0, 0.0)


def test_a_timeout_lasts_until_the_next_message_also_if_the_loss_grows() -> None:
    periodic = regular_source(10, 1.0)
    now = periodic.received_at + MIN_TIMEOUT_S
    assert periodic.is_silent(now, 0.0)
    assert periodic.is_silent(now, 0.8)
    periodic.received(now)
    assert not periodic.is_silent(now, 0.0)


def numbered(message: Message, number: int) -> Message:
    codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    codec.seq = number % 256
    frame = message.pack(codec)
    [decoded] = mavlink.MAVLink(None).parse_buffer(frame)
    return decoded


def heartbeat(number: int) -> Message:
    return numbered(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3), number)


def in_mode(mode: int, number: int) -> Message:
    return numbered(mavlink.MAVLink_heartbeat_message(2, 12, 0, mode, 4, 3), number)


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
        order.is_overtaken(in_mode(count, old + count), 0.02 * count)
    overtaken = [
        order.is_overtaken(in_mode(1000 + count, new + count), 0.4 + 0.02 * count)
        for count in range(200)
    ]
    assert sum(overtaken) < BEHIND_IN_A_ROW
    assert not any(overtaken[BEHIND_IN_A_ROW:])


def _telemetry(count: int) -> list[Message]:
    """A heartbeat, then messages that change."""
    attitudes = [mavlink.MAVLink_attitude_message(count, *[0.1 * one] * 6) for one in range(4)]
    return [mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3), *attitudes]


@given(
    delay=st.integers(1, 80),
    block=st.integers(1, 40),
    pause_s=st.sampled_from([0.0, 0.2, 0.6, 1.0]),
)
def test_copies_of_frames_that_come_later_change_nothing(
    delay: int, block: int, pause_s: float
) -> None:
    """However many come in a row, and however long nothing came before, within their time."""
    assume((delay / block + 2) * (pause_s + 0.02 * block) < COPIED_WITHIN_S)
    vehicle, order, now = Encoder(1, 1), StateOrder(), 0.0
    frames = [vehicle.encode(one) for count in range(120) for one in _telemetry(count)]
    sent = [(Decoder().decode(frame)[0], number) for number, frame in enumerate(frames)]
    newest = -1
    for first in range(0, len(sent), block):
        late = sent[max(first - delay, 0) : max(first - delay + block, 0)]
        for message, number in [*sent[first : first + block], *late]:
            now += 0.01
            is_overtaken = order.is_overtaken(message, now)
            if message.get_type() == "HEARTBEAT":
                assert is_overtaken == (number < newest)
                newest = max(newest, number)
        now += pause_s


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
