"""Which flights of a vehicle have their frames sent, when, and how often that is tried."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from itertools import count

import pytest

from mavlink_broker.effects import Effects, FramesNotSent, FramesOutcome, FramesSent, SendFrames
from mavlink_broker.vehicle.flight_frames import FlightFrames
from mavlink_broker.vehicle.logged_flight import LONGEST_PAUSE_S, MAX_FAILURES, MAX_FLIGHTS
from mavlink_broker.vehicle.vehicle import Vehicle
from tests.support.log_air import ROUTE

NOON = datetime(2026, 3, 1, 12, 0, tzinfo=UTC)
LIMIT_BYTES = 1_000_000


def sent(job: SendFrames) -> FramesOutcome:
    return FramesSent(job.number, 0 if job.flight is None else 100)


def away(job: SendFrames) -> FramesOutcome:
    return FramesNotSent(job.number, "no answer", is_final=False, is_temporary=True)


def broken(job: SendFrames) -> FramesOutcome:
    return FramesNotSent(job.number, "HTTP 500", is_final=False)


def refused(job: SendFrames) -> FramesOutcome:
    return FramesNotSent(job.number, "HTTP 413 too large", is_final=True)


class World:
    """A vehicle, and a worker that answers each job at the next step."""

    def __init__(self, limit_bytes: int = LIMIT_BYTES) -> None:
        self.vehicle = Vehicle(7, ROUTE)
        self.vehicle.snapshot.armed = False
        names = (f"frames-{number}" for number in count(1))
        self.frames = FlightFrames(self.vehicle, lambda: next(names), limit_bytes=limit_bytes)
        self.answer: Callable[[SendFrames], FramesOutcome] | None = sent
        self.jobs: list[SendFrames] = []
        self._unanswered: list[SendFrames] = []
        self._now_s = 0.0

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds)):
            self._now_s += 1.0
            if self.answer is not None:
                for job in self._unanswered:
                    self.frames.take_outcome(self.answer(job), self._now_s)
                self._unanswered.clear()
            effects = Effects()
            self.frames.step(self._now_s, NOON + timedelta(seconds=self._now_s), effects)
            new = [job for job in effects.jobs if isinstance(job, SendFrames)]
            self.jobs += new
            self._unanswered += new

    def fly(self, seconds: float = 60.0) -> None:
        self.vehicle.snapshot.armed = True
        self.run(seconds)
        self.vehicle.snapshot.armed = False
        self.run(1)

    @property
    def flights(self) -> list[str]:
        """Names of the flights whose frames were to be sent, in order."""
        return [job.flight.name for job in self.jobs if job.flight is not None]


def test_the_frames_of_a_flight_are_sent_once_after_the_landing() -> None:
    world = World()
    world.run(5)
    world.fly(60)
    assert world.flights == []
    world.run(600)
    first, job = world.jobs
    assert first.flight is None  # What an earlier run has begun
    assert (job.vehicle_id, job.system, job.limit_bytes) == (7, ROUTE.target_system, LIMIT_BYTES)
    assert job.flight is not None
    assert job.flight.started_at == NOON + timedelta(seconds=6)
    assert job.flight.ended_at == NOON + timedelta(seconds=66)


def test_nothing_is_sent_without_a_frame_log() -> None:
    world = World(limit_bytes=0)
    world.fly()
    world.run(600)
    assert world.jobs == []


def test_two_flights_are_sent_one_after_the_other() -> None:
    world = World()
    world.fly()
    world.fly()
    world.run(600)
    assert world.flights == ["frames-1", "frames-2"]


def test_an_edge_server_that_is_away_is_waited_for() -> None:
    world = World()
    world.fly()
    world.answer = away
    world.run(20 * LONGEST_PAUSE_S)
    assert len(world.flights) > MAX_FAILURES
    world.answer = sent
    world.run(2 * LONGEST_PAUSE_S)
    attempts = len(world.jobs)
    world.run(2 * LONGEST_PAUSE_S)
    assert len(world.jobs) == attempts
    assert set(world.flights) == {"frames-1"}


def test_what_fails_repeatedly_is_given_up_and_the_next_flight_is_sent(
    caplog: pytest.LogCaptureFixture,
) -> None:
    world = World()
    world.run(2)
    world.answer = broken
    world.fly()
    world.run(20 * LONGEST_PAUSE_S)
    assert world.flights == ["frames-1"] * MAX_FAILURES
    assert "the frames of its flight that began at 12:00:03 are not sent: HTTP 500" in caplog.text
    world.answer = sent
    world.fly()
    world.run(2 * LONGEST_PAUSE_S)
    assert world.flights[MAX_FAILURES:] == ["frames-2"]


def test_a_final_refusal_is_not_repeated(caplog: pytest.LogCaptureFixture) -> None:
    world = World()
    world.run(2)
    world.answer = refused
    world.fly()
    world.run(2 * LONGEST_PAUSE_S)
    assert world.flights == ["frames-1"]
    assert "HTTP 413 too large" in caplog.text


@pytest.mark.parametrize("answers", [away, None])
def test_no_more_flights_than_the_limit_wait(
    answers: Callable[[SendFrames], FramesOutcome] | None,
) -> None:
    """Also while one is being sent, which is not forgotten."""
    world = World()
    world.run(2)
    world.answer = answers
    for _ in range(MAX_FLIGHTS + 3):
        world.fly(5)
        world.run(10)
    world.answer = sent
    world.run(20 * LONGEST_PAUSE_S)
    names = list(dict.fromkeys(world.flights))
    newest = [f"frames-{number}" for number in range(4, MAX_FLIGHTS + 4)]
    if answers is None:
        assert names == ["frames-1", *newest[1:]]
    else:
        assert names[-MAX_FLIGHTS:] == newest
