import pytest

from dst.scheduler import EPOCH, Clock, Scheduler


def order_of_equals(seed: int) -> list[int]:
    scheduler, taken = Scheduler(seed), list[int]()
    for number in range(8):
        scheduler.after(1.0, lambda number=number: taken.append(number))  # type: ignore[misc]
    scheduler.run_until(1.0)
    return taken


def test_actions_are_taken_in_the_order_of_their_time() -> None:
    scheduler, taken = Scheduler(1), list[float]()
    for delay_s in (3.0, 1.0, 2.0):
        scheduler.after(delay_s, lambda: taken.append(scheduler.now_s))
    scheduler.run_until(2.5)
    assert taken == [1.0, 2.0]
    assert scheduler.now_s == 2.5


def test_the_seed_orders_actions_of_the_same_time() -> None:
    assert order_of_equals(1) == order_of_equals(1)
    assert order_of_equals(1) != order_of_equals(2)


def test_a_cancelled_action_is_not_taken() -> None:
    scheduler, taken = Scheduler(1), list[int]()
    scheduler.after(1.0, lambda: taken.append(1)).cancel()
    scheduler.run_until(2.0)
    assert taken == []


def test_a_periodic_action_is_repeated() -> None:
    scheduler, taken = Scheduler(1), list[float]()
    scheduler.every(0.5, lambda: taken.append(scheduler.now_s))
    scheduler.run_until(1.2)
    assert taken == [0.0, 0.5, 1.0]


def test_sources_of_random_numbers_are_independent() -> None:
    one, other = Scheduler(7), Scheduler(7)
    one.random("a").random()
    assert one.random("b").random() == other.random("b").random()
    assert one.random("a").random() != one.random("b").random()


def test_the_clocks_follow_the_virtual_time() -> None:
    scheduler = Scheduler(1)
    clock = Clock(scheduler)
    before = clock.monotonic()
    scheduler.run_until(60.0)
    assert clock.monotonic() - before == 60.0
    assert (clock.utc() - EPOCH).total_seconds() == 60.0
    assert clock.epoch_s() == clock.utc().timestamp()


def test_a_step_changes_the_time_of_day_alone_and_a_drift_all_clocks() -> None:
    scheduler = Scheduler(1)
    clock, right = Clock(scheduler), Clock(scheduler)
    clock.step(-3600.0)
    assert clock.epoch_s() - right.epoch_s() == -3600.0
    assert clock.monotonic() == right.monotonic()
    clock.run(1e-3)
    scheduler.run_until(1000.0)
    assert clock.monotonic() - right.monotonic() == pytest.approx(1.0)
    assert (clock.utc() - right.utc()).total_seconds() == pytest.approx(-3599.0)


def test_a_clock_that_drifts_otherwise_does_not_jump_and_may_be_set_right() -> None:
    scheduler = Scheduler(1)
    clock = Clock(scheduler)
    scheduler.run_until(43_200.0)
    before = clock.monotonic()
    clock.run(-5e-4)
    assert clock.monotonic() == before
    scheduler.run_until(86_400.0)
    assert clock.error_s == pytest.approx(-21.6)
    clock.step(70.0)
    clock.set_right()
    assert clock.monotonic() - before == pytest.approx(43_178.4)
    scheduler.run_until(172_800.0)
    assert (clock.error_s, clock.epoch_s()) == (0.0, EPOCH.timestamp() + 172_800.0)


def test_the_digest_covers_lines_that_are_no_longer_kept() -> None:
    digests = set()
    for first in "ab":
        scheduler = Scheduler(1, kept_lines=1)
        scheduler.note("broker", "vehicle 1", first)
        scheduler.note("broker", "vehicle 1", "HEARTBEAT")
        assert list(scheduler.trace.lines) == ["      0.0000  broker > vehicle 1: HEARTBEAT"]
        digests.add(scheduler.trace.digest)
    assert len(digests) == 2
