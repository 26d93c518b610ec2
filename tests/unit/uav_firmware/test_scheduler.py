from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.module_errors import end_flight
from uav_firmware.scheduler import LateSteps, Pacer, RateGroup, ScheduleError, Scheduler


class Clock:
    """A wall clock that moves only when a test or a wait moves it."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.waits: list[float] = []

    def __call__(self) -> float:
        return self.now_s

    def wait(self, seconds: float) -> None:
        self.waits.append(seconds)
        self.now_s += seconds


def record(steps: int, *groups: tuple[str, int, int]) -> list[list[str]]:
    ran: list[str] = []

    def runner(name: str) -> Callable[[], None]:
        return lambda: ran.append(name)

    scheduler = Scheduler(
        4000,
        [RateGroup(name, period_us, runner(name), phase) for name, period_us, phase in groups],
        end_flight,
    )
    result = []
    for _ in range(steps):
        ran.clear()
        scheduler.step()
        result.append(list(ran))
    return result


def test_each_group_runs_at_its_rate() -> None:
    steps = record(50, ("fast", 4000, 0), ("slow", 20_000, 0), ("slower", 100_000, 0))
    names = [name for step in steps for name in step]
    assert names.count("fast") == 50
    assert names.count("slow") == 10
    assert names.count("slower") == 2


def test_groups_run_in_their_order() -> None:
    assert record(1, ("b", 4000, 0), ("a", 4000, 0), ("c", 8000, 0)) == [["b", "a", "c"]]


def test_a_phase_moves_a_group_to_another_step() -> None:
    assert record(4, ("a", 8000, 0), ("b", 8000, 1)) == [["a"], ["b"], ["a"], ["b"]]


@pytest.mark.parametrize("period_us", [0, 3000, 5000, -4000])
def test_a_period_that_is_no_multiple_of_the_step_is_refused(period_us: int) -> None:
    with pytest.raises(ScheduleError, match="odd"):
        Scheduler(4000, [RateGroup("odd", period_us, lambda: None)], end_flight)


def test_periods_that_never_meet_are_refused() -> None:
    with pytest.raises(ScheduleError, match="repeat"):
        Scheduler(
            1000,
            [RateGroup("a", 101_000, lambda: None), RateGroup("b", 103_000, lambda: None)],
            end_flight,
        )


def test_an_error_costs_its_group_one_run_and_no_other_group_any() -> None:
    ran, errors = [], []

    def fail() -> None:
        ran.append("failing")
        raise ZeroDivisionError(len(ran))

    groups = [
        RateGroup("before", 4000, lambda: ran.append("before")),
        RateGroup("failing", 8000, fail),
        RateGroup("behind", 4000, lambda: ran.append("behind")),
    ]
    scheduler = Scheduler(4000, groups, lambda name, error: errors.append((name, str(error))))
    for _ in range(3):
        scheduler.step()
    step = ["before", "failing", "behind"]
    assert ran == [*step, "before", "behind", *step]
    assert errors == [("failing", "2"), ("failing", "7")]


def test_an_interrupt_is_no_error_of_a_group() -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    scheduler = Scheduler(4000, [RateGroup("a", 4000, interrupt)], lambda _name, _error: None)
    with pytest.raises(KeyboardInterrupt):
        scheduler.step()


@pytest.mark.parametrize("speed", [0.5, 1.0, 5.0, 10.0])
def test_the_wall_clock_passes_at_the_wanted_ratio(speed: float) -> None:
    clock = Clock()
    pacer = Pacer(speed, clock=clock, wait=clock.wait)
    for step in range(1, 10_001):
        clock.now_s += 0.0001
        pacer.pace(step * 4000)
    assert clock.now_s - 100.0 == pytest.approx(40.0 / speed, abs=0.17)
    assert pacer.overruns == 0


def test_unpaced_never_waits() -> None:
    clock = Clock()
    pacer = Pacer(0.0, clock=clock, wait=clock.wait)
    for step in range(100):
        pacer.pace(step * 4000)
    assert clock.waits == []


@pytest.mark.parametrize("hindered_s", [0.0, 0.06])
def test_a_batch_that_begins_late_by_less_than_a_batch_misses_no_deadline(
    hindered_s: float,
) -> None:
    clock = Clock()

    def wait(seconds: float) -> None:
        clock.wait(seconds + hindered_s)

    pacer = Pacer(1.0, clock=clock, wait=wait)
    for step in range(1, 1001):
        clock.now_s += 0.0005
        pacer.pace(step * 4000)
    assert pacer.overruns == 0
    assert 20 < len(clock.waits) < 120


def paced(
    clock: Clock, seconds: float, *, batch_us: int = 80_000, speed: float = 1.0
) -> list[tuple[float, float]]:
    """Fly and give, for each step, the clock's time at its end and its own, from the first one."""
    pacer = Pacer(speed, clock=clock, wait=clock.wait, batch_us=lambda: batch_us)
    ends = []
    for step in range(1, round(seconds / 0.004) + 1):
        ends.append((clock.now_s - 100.0, (step - 1) * 0.004 / speed))
        pacer.pace(step * 4000)
    return ends


@given(batch_us=st.integers(0, 1_000_000), speed=st.floats(0.1, 20.0))
def test_no_step_is_late_nor_further_ahead_than_two_batches(batch_us: int, speed: float) -> None:
    for wall_s, own_s in paced(Clock(), 4.0, batch_us=batch_us, speed=speed):
        assert -1e-9 <= own_s - wall_s <= 2 * 0.08 + 0.004 / speed + 1e-9


@pytest.mark.parametrize(("batch_us", "waits_a_second"), [(20_000, 50), (40_000, 25), (80_000, 12)])
def test_a_batch_is_as_long_as_may_be(batch_us: int, waits_a_second: int) -> None:
    clock = Clock()
    paced(clock, 10.0, batch_us=batch_us)
    assert len(clock.waits) / 10.0 == pytest.approx(waits_a_second, rel=0.2)


def test_the_next_steps_run_at_once_when_somebody_waits_for_them() -> None:
    clock = Clock()
    pending = False

    def wait(seconds: float) -> None:
        nonlocal pending
        pending = len(clock.waits) == 20
        clock.wait(seconds / 2 if pending else seconds)

    pacer = Pacer(1.0, clock=clock, wait=wait, is_command_pending=lambda: pending)
    asked_at_s: list[float] = []
    for step in range(1, 1001):
        if pending:
            asked_at_s.append(clock.now_s)
            pending = len(asked_at_s) < 5
        pacer.pace(step * 4000)
    assert len(asked_at_s) == 5
    assert len(set(asked_at_s)) == 1
    assert pacer.overruns == 0


def test_whoever_asks_without_end_does_not_drive_the_flight_ahead_of_the_clock() -> None:
    clock = Clock()
    pacer = Pacer(1.0, clock=clock, wait=clock.wait, is_command_pending=lambda: True)
    for step in range(1, 2501):
        pacer.pace(step * 4000)
    assert clock.now_s - 100.0 == pytest.approx(10.0, abs=0.25)


def test_a_late_step_is_counted_and_made_up() -> None:
    clock = Clock()
    pacer = Pacer(1.0, clock=clock, wait=clock.wait)
    for step in range(1, 101):
        clock.now_s += 0.18 if step == 50 else 0.001
        pacer.pace(step * 4000)
    assert 1 <= pacer.overruns < 30
    assert clock.now_s - 100.001 == pytest.approx(99 * 0.004, abs=0.17)
    assert pacer.given_up_s == 0.0


def test_after_a_long_pause_only_a_bounded_part_is_made_up() -> None:
    clock = Clock()
    pacer = Pacer(1.0, clock=clock, wait=clock.wait)
    waits_before = burst = 0
    for step in range(1, 1001):
        clock.now_s += 60.0 if step == 500 else 0.001
        pacer.pace(step * 4000)
        if step == 500:
            waits_before = len(clock.waits)
        elif step > 500 and len(clock.waits) == waits_before:
            burst += 1
    assert 10 < burst < 100
    assert pacer.given_up_s == pytest.approx(60.0, abs=0.3)


@pytest.mark.parametrize("speed", [-1.0, float("nan"), float("inf")])
def test_a_speed_that_is_no_ratio_is_refused(speed: float) -> None:
    clock = Clock()
    with pytest.raises(ScheduleError, match="speed"):
        Pacer(speed, clock=clock, wait=clock.wait)


def test_late_steps_are_told_once_in_ten_seconds_and_only_if_there_are_any() -> None:
    clock, reported = Clock(), list[tuple[int, str]]()
    pacer = Pacer(1.0, clock=clock, wait=clock.wait)
    late = LateSteps(pacer, lambda time_us, text: reported.append((time_us, text)))
    for step in range(1, 3 * LateSteps.EVERY_STEPS + 1):
        clock.now_s += 0.2 if step == LateSteps.EVERY_STEPS + 500 else 0.0001
        pacer.pace(step * 4000)
        if pacer.steps == late.due:
            late.report(step * 4000)
    assert reported == [(20_000_000, f"{pacer.overruns} of the last 2500 steps late")]
    assert pacer.overruns > 0
