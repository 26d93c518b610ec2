"""The fixed-step loop: which rate group runs in which step, and how steps meet the wall clock.

Everything runs in one thread, in the order of declaration, by simulated (or sampled) time; the
wall clock only determines the wait between two steps. That keeps a flight deterministic at any
speed.

ScheduleError(ValueError) is raised for a rate that the step cannot keep.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

_MAX_SLOTS: Final = 10_000  # a longer pattern means that the periods do not fit together
LONGEST_BATCH_US: Final = 80_000  # [us] Of vehicle time, when telemetry is slow
_BATCH_S: Final = (0.02, 0.08)  # [s] Shortest and longest batch by the wall clock
_LARGEST_LEAD_S: Final = (
    0.2  # [s] By which the steps that carry out a pending command run ahead at most
)
_CATCH_UP_S: Final = 0.1  # [s] Lateness that is made up; more of it is dropped


class ScheduleError(ValueError):
    """A period is no multiple of the step, or the pattern of all periods is too long."""


class RateGroup(NamedTuple):
    """Work done every `period_us`."""

    name: str
    period_us: int  # [us] A multiple of the step
    run: Callable[[], None]
    phase: int = 0  # [steps] Later than step 0, to spread slow groups over the steps


class Scheduler:
    """Runs the rate groups due in each step, in their order."""

    def __init__(
        self,
        step_us: int,
        groups: Sequence[RateGroup],
        on_error: Callable[[str, Exception], None],
    ) -> None:
        """Lay out one period of the whole pattern.

        Args:
            step_us: Period of the loop [us].
            groups: In the order in which they run within a step.
            on_error: Receives the name of a group that has raised, and its error; the groups
                behind it run. An error that it raises ends the loop.

        Raises:
            ScheduleError: if a period does not fit the step.
        """
        self.step_us = step_us
        self.groups = tuple(groups)
        dividers = [_divider(group, step_us) for group in groups]
        slots = math.lcm(*dividers) if dividers else 1
        if slots > _MAX_SLOTS:
            raise ScheduleError(f"the rates repeat only after {slots} steps")
        runs = [(group.name, group.run) for group in groups]  # Few, so that they stay in the cache
        self._slots = tuple(
            tuple(
                run
                for run, group, divider in zip(runs, groups, dividers, strict=True)
                if slot % divider == group.phase % divider
            )
            for slot in range(slots)
        )
        self._next = 0
        self.on_error = on_error

    def step(self) -> None:
        """Run what is due in this step."""
        for name, run in self._slots[self._next]:
            try:
                run()
            except Exception as error:  # noqa: BLE001  # whatever it is, the others fly on
                self.on_error(name, error)
        self._next += 1
        if self._next == len(self._slots):
            self._next = 0


def _divider(group: RateGroup, step_us: int) -> int:
    divider, rest = divmod(group.period_us, step_us)
    if rest or divider < 1:
        raise ScheduleError(
            f"{group.name}: period {group.period_us} us is no multiple of the step, {step_us} us"
        )
    return divider


class Pacer:
    """Keeps simulated time at `speed` times the wall clock.

    Steps run in batches, ahead of the clock, because the first step after a wait takes five
    times as long as the tenth: the processor's caches are cold. The length of each batch is read
    before it begins, in vehicle time; it takes 20 to 80 ms of the wall clock. A batch begins one
    batch ahead of the clock and ends two ahead, so that neither a slow first step nor one that
    waits for a processor is late. While a command is pending, its steps run at once, up to
    200 ms ahead.

    A step is due when the wall clock reaches the simulated time at its end; one that ends later
    has missed its deadline and is an overrun. Lateness up to a tenth of a second is made up by
    steps without a wait; more is dropped (the flight falls behind the clock), so that a machine
    that was suspended does not run a burst of steps.
    """

    def __init__(
        self,
        speed: float,
        *,
        clock: Callable[[], float],
        wait: Callable[[float], None],
        batch_us: Callable[[], int] = lambda: LONGEST_BATCH_US,
        is_command_pending: Callable[[], bool] = lambda: False,
    ) -> None:
        """Begin with the first step that is paced.

        Args:
            speed: Simulated time per wall-clock time; 0 means unpaced.
            clock: Wall clock [s], which never decreases.
            wait: Waits for so many seconds, or fewer when a datagram arrives.
            batch_us: Longest batch [us] of vehicle time from now on.
            is_command_pending: Whether a peer waits for the next steps.
        """
        if not (math.isfinite(speed) and speed >= 0.0):
            raise ScheduleError(f"speed: {speed} is not a finite number of 0 or more")
        self.speed = speed
        self.steps = 0
        self.overruns = 0
        self.given_up_s = 0.0  # [s] Wall-clock time by which the flight fell behind
        self._clock = clock
        self._wait = wait
        self._batch_us = batch_us
        self._is_command_pending = is_command_pending
        self._batch_ends_s = 0.0  # [s] Lead at which the present batch is over
        self._origin_s: float | None = None

    def pace(self, simulated_us: int) -> None:
        """Wait until the wall clock has reached the simulated time; called after each step."""
        self.steps += 1
        if self.speed == 0.0:
            return
        now_s = self._clock()
        due_s = simulated_us * 1e-6 / self.speed
        if self._origin_s is None:
            self._origin_s = now_s - due_s
        ahead_s = self._origin_s + due_s - now_s
        if ahead_s >= self._batch_ends_s:
            self._end_batch(self._origin_s + due_s)
        elif ahead_s < 0.0:
            self.overruns += 1
            late_s = -ahead_s - _CATCH_UP_S
            if late_s > 0.0:
                self.given_up_s += late_s
                self._origin_s += late_s

    def _end_batch(self, due_s: float) -> None:
        """Wait until the step due at `due_s` of the clock is ahead by the next batch alone."""
        shortest_s, longest_s = _BATCH_S
        batch_s = min(max(self._batch_us() * 1e-6 / self.speed, shortest_s), longest_s)
        self._batch_ends_s = 2.0 * batch_s
        begin_s = due_s - batch_s
        while (left_s := begin_s - self._clock()) > 0.0:
            if left_s + batch_s < _LARGEST_LEAD_S and self._is_command_pending():
                return
            self._wait(left_s)


class LateSteps:
    """Reports every 2500 steps how many of them missed their deadline, if any did."""

    EVERY_STEPS: Final = 2500  # Ten seconds of vehicle time

    def __init__(self, pacer: Pacer, write: Callable[[int, str], None]) -> None:
        self.due = self.EVERY_STEPS
        self._pacer = pacer
        self._write = write
        self._reported = 0

    def report(self, time_us: int) -> None:
        """Write the line, and set the step of the next one."""
        self.due += self.EVERY_STEPS
        late, self._reported = self._pacer.overruns - self._reported, self._pacer.overruns
        if late > 0:
            self._write(time_us, f"{late} of the last {self.EVERY_STEPS} steps late")
