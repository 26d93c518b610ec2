from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.modules.mavlink.wire.schedule import LONGEST_INTERVAL_US, Schedule

STEP_US = 4000


def counts(schedule: Schedule, duration_us: int, start_us: int = 0) -> dict[int, int]:
    """How often each message was due."""
    seen: dict[int, int] = {}
    for now_us in range(start_us, start_us + duration_us, STEP_US):
        for message_id in schedule.take_due(now_us):
            seen[message_id] = seen.get(message_id, 0) + 1
    return seen


@given(st.integers(0, 500), st.sampled_from([4_000, 20_000, 66_667, 100_000, 500_000, 1_000_000]))
def test_a_message_is_due_at_its_rate(message_id: int, interval_us: int) -> None:
    seen = counts(Schedule({message_id: interval_us}), 10_000_000)
    assert abs(seen[message_id] - 10_000_000 / interval_us) <= 1.0 + 10_000_000 / interval_us * 0.01


@given(st.integers(0, 500), st.integers(1, 40))
def test_two_peers_with_one_rate_are_due_in_the_same_step(message_id: int, late_steps: int) -> None:
    early, late = Schedule({message_id: 100_000}), Schedule({})
    joined_us = late_steps * STEP_US
    counts(early, joined_us)
    late.set_interval(message_id, 100_000, joined_us)
    counts(early, 200_000, joined_us)
    counts(late, 200_000, joined_us)
    for now_us in range(joined_us + 200_000, joined_us + 600_000, STEP_US):
        assert early.take_due(now_us) == late.take_due(now_us)


def test_messages_of_one_rate_are_spread_over_the_steps() -> None:
    schedule = Schedule(dict.fromkeys(range(20), 1_000_000))
    schedule.take_due(0)
    most = max(len(schedule.take_due(now)) for now in range(STEP_US, 2_000_000, STEP_US))
    assert most <= 2


def test_set_interval_starts_and_stops_a_stream() -> None:
    schedule = Schedule({1: 1_000_000})
    schedule.take_due(0)
    schedule.set_interval(2, 500_000, 8_000)
    assert schedule.take_due(8_000) == [2]
    schedule.set_interval(2, 0, 12_000)
    schedule.set_interval(1, 0, 12_000)
    assert counts(schedule, 3_000_000, 12_000) == {}


def test_missed_times_are_not_caught_up() -> None:
    schedule = Schedule({1: 100_000})
    schedule.take_due(0)
    assert schedule.take_due(60_000_000) == [1]
    assert schedule.take_due(60_000_000 + STEP_US) == []


def test_intervals_and_defaults_are_reported() -> None:
    schedule = Schedule({1: 1_000_000})
    schedule.set_interval(1, 250_000, 0)
    assert (schedule.interval_us(1), schedule.default_interval_us(1)) == (250_000, 1_000_000)
    assert (schedule.interval_us(2), schedule.default_interval_us(2)) == (0, 0)


def test_the_shortest_interval_follows_requests() -> None:
    schedule = Schedule({1: 100_000, 2: 1_000_000})
    assert schedule.shortest_interval_us == 100_000
    schedule.set_interval(2, 20_000, 0)
    assert schedule.shortest_interval_us == 20_000
    for message_id in (1, 2):
        schedule.set_interval(message_id, 0, 0)
    assert schedule.shortest_interval_us == LONGEST_INTERVAL_US


def test_of_one_message_of_several_components_the_autopilots_is_first_and_last() -> None:
    cameras = [100 << 24, 101 << 24]
    schedule = Schedule(dict.fromkeys((0, 1, *cameras), 1_000_000))
    due = [schedule.take_due(now_us) for now_us in range(0, 5_000_000, STEP_US)]
    together = [keys for keys in due if set(keys) & {0, *cameras}]
    assert [[key for key in keys if key != 1] for keys in together] == [[0, *cameras, 0]] * 5


def test_a_component_that_is_asked_again_comes_back_between_the_autopilots() -> None:
    schedule = Schedule({0: 1_000_000, 100 << 24: 1_000_000})
    schedule.take_due(0)
    schedule.set_interval(100 << 24, 500_000, 300_000)
    assert schedule.take_due(300_000) == [100 << 24]
    assert schedule.take_due(500_000) == [100 << 24]
    assert schedule.take_due(1_000_000) == [0, 100 << 24, 0]
