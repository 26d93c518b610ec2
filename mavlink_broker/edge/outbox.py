"""Posts that wait to be sent to the edge server, and which is next. Pure: no thread, no network.

Each lane keeps its order: one lane per vehicle and kind, and one for a mission's reports together
with the acknowledgements of its work. A lane whose first post has failed waits for its own
back-off. A vehicle's reports wait until the edge server has answered its registration. The most
urgent lane goes first, except that each fourth post comes from the lane that has waited longest:
no lane starves while a slow edge server answers fewer posts than arrive.

While the edge server is unreachable for long, the oldest state vectors are dropped and counted, and
a newer description of a vehicle replaces the one that waits. Every other post is kept, and is
offered to the spool writer: posts that have failed once, and those behind them in their lane.

The outbox gives a post up when it is refused for good or fails again and again, so that the posts
behind it are sent; the post becomes a dead letter. It takes 20 failures to give up. A failure
counts only if the edge server has given a final answer to another post since the previous failure:
while the edge server is unreachable, or fails for every post, no post is given up. A temporary
refusal (`is_temporary` in `failed`) does not count either.

A full edge server refuses results (pose, observations, battery) and still takes mission reports and
acknowledgements. These then go past the results in their lane, in their own order: an operator must
learn that an abort is done. The results keep their place and their order.

An acceptance never becomes a dead letter: sent again later, it would make the edge server expect a
mission that the broker has dropped. The mission whose acceptance is given up is reported as FAILED.
"""

import math
import random
from collections import Counter, deque
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import islice, takewhile
from typing import Any, Final

MISSION_REPORT_PATH: Final = "/mission_report/"
MAX_STATE_VECTORS: Final = 3600
"""An hour of one vehicle; some 2 MB."""
FIRST_PAUSE_S: Final = 0.2
LONGEST_PAUSE_S: Final = 5.0
MAX_ATTEMPTS: Final = 20
"""Failures of one post while others were answered: more than a minute."""
MAX_DEAD_LETTERS: Final = 1000
"""Dead letters that wait for the spool writer; without a spool the newest are kept."""
SLOW_AFTER_S: Final = 3.0
"""After this time without an answer the edge server counts as unreachable."""
LONGEST_WAITING_EVERY: Final = 4
"""Each fourth post comes from the lane that has waited longest, whatever its urgency."""


class Urgency(IntEnum):
    """Which lane goes first when several are ready."""

    REGISTRATION = 0
    ALARM = 1
    REPORT = 2
    RESULT = 3
    TELEMETRY = 4
    PICTURE = 5


@dataclass(slots=True, kw_only=True)
class Post:
    """One request that needs a final answer."""

    method: str
    path: str
    body: dict[str, Any]
    vehicle_id: int
    lane: str
    urgency: Urgency
    idempotency_key: str | None = None
    needs_registration: bool = True
    may_be_dropped: bool = False
    may_be_duplicate: bool = False  # A run that crashed may have sent it: the first one counts
    replaces: bool = False  # A newer one of the same lane makes it obsolete
    spool_number: int | None = None  # In the spool, if it is there
    is_inherited: bool = False  # From an earlier run of the broker
    is_retried: bool = False  # It was given up, and a person has it sent again
    accepted_work_id: int | None = None  # The work that it accepts: the answer decides
    attempts: int = 0  # Failures of its own, while others were answered
    answers_before: int = 0  # How many others had been answered at its last failure

    @property
    def must_survive(self) -> bool:
        """Whether it must survive the broker; the next run sends the others anew."""
        return not (self.may_be_dropped or self.replaces)

    @property
    def is_acceptance(self) -> bool:
        """Whether it accepts work."""
        return self.path.endswith("/ack") and self.body.get("status") == "accepted"

    @property
    def is_result(self) -> bool:
        """Whether it is a result of a command or a picture, the same whenever it is posted.

        A report or an acknowledgement that was a dead letter may be a duplicate too.
        """
        return self.may_be_duplicate and not self._changes_work

    @property
    def _changes_work(self) -> bool:
        """Whether the edge server learns from it how far a mission or an event is."""
        return self.path == MISSION_REPORT_PATH or self.path.endswith("/ack")

    @property
    def is_inherited_report(self) -> bool:
        """Whether the edge server knows less of a mission than an earlier run until it is sent.

        Work waits for it; not for one that was given up, and that may fail for ever.
        """
        is_report = self.urgency is Urgency.REPORT and not self.is_result
        return self.is_inherited and is_report and not self.is_retried


@dataclass(frozen=True, slots=True)
class DeadLetter:
    """A post that was given up, and why."""

    post: Post
    reason: str


@dataclass(slots=True)
class _Lane:
    urgency: Urgency
    vehicle_id: int
    posts: deque[Post] = field(default_factory=deque)
    in_flight: Post | None = None
    posts_ahead: int = 0  # Results that the post in flight has gone past
    result_not_before: float | None = None  # While the result at the head is refused for space
    taken_at: float = -math.inf  # When the newest post was taken to be sent
    failures: int = 0
    is_unreachable: bool = False  # At the last failure
    not_before: float = 0.0
    attempts: int = 0  # As of a post: of lanes in which a newer post replaces the one that failed
    answers_before: int = 0

    def is_slow(self, now: float) -> bool:
        """Whether an answer is overdue."""
        return self.in_flight is not None and now - self.taken_at > SLOW_AFTER_S

    def all(self) -> Iterator[Post]:
        """Give every post without an answer, in order."""
        yield from islice(self.posts, self.posts_ahead)
        if self.in_flight is not None:
            yield self.in_flight
        yield from islice(self.posts, self.posts_ahead, None)

    def candidates(self) -> Iterator[tuple[int, float]]:
        """Give the places of the posts that may be next, and the time of each."""
        if not self.posts or self.in_flight is not None:
            return
        if self.result_not_before is None:
            yield 0, self.not_before
            return
        yield 0, max(self.result_not_before, self.not_before)
        others = (place for place, post in enumerate(self.posts) if not post.is_result)
        for place in islice(others, 1):
            yield place, self.not_before

    def take(self, place: int) -> Post:
        """Take the post at a place out, to be sent."""
        post = self.posts[place]
        del self.posts[place]
        self.in_flight, self.posts_ahead = post, place
        return post

    def put_back(self) -> None:
        """Put the post in flight back to its place."""
        if self.in_flight is not None:
            self.posts.insert(self.posts_ahead, self.in_flight)
        self.close()

    def close(self) -> None:
        """End the flight of a post."""
        self.in_flight, self.posts_ahead = None, 0

    @property
    def has_failed(self) -> bool:
        """Whether a post that waits here has failed and was not answered since."""
        return bool(self.failures) or self.result_not_before is not None

    def unspooled(self) -> list[Post]:
        """Give the posts that belong in the spool and are not there; those that are come first."""
        first = next(self.all(), None)
        if first is None or not first.must_survive:
            return []
        tail = list(takewhile(lambda post: post.spool_number is None, reversed(self.posts)))[::-1]
        if self.in_flight is not None and self.in_flight.spool_number is None:
            tail.insert(max(0, self.posts_ahead - (len(self.posts) - len(tail))), self.in_flight)
        return tail


class Outbox:
    """Lanes of posts; the caller sends the post that `take` gives and reports the outcome."""

    def __init__(
        self, jitter: random.Random, *, max_state_vectors: int = MAX_STATE_VECTORS
    ) -> None:
        self._jitter = jitter
        self._max_state_vectors = max_state_vectors
        self._lanes: dict[tuple[int, str], _Lane] = {}
        self._registered: set[int] = set()
        self._released: set[int] = set()
        self._inherited_reports: Counter[int] = Counter()
        self._answers = 0
        self._turns = 0
        self._dead_letters: deque[DeadLetter] = deque(maxlen=MAX_DEAD_LETTERS)
        self.dropped = 0

    def __len__(self) -> int:
        return sum(len(lane.posts) + (lane.in_flight is not None) for lane in self._all)

    def put(self, post: Post) -> None:
        """Add a post to the end of its lane."""
        key = post.vehicle_id, post.lane
        lane = self._lanes.setdefault(key, _Lane(post.urgency, post.vehicle_id))
        if post.replaces:
            lane.posts.clear()
        lane.posts.append(post)
        self._inherited_reports[post.vehicle_id] += post.is_inherited_report
        if post.may_be_dropped and self._droppable() > self._max_state_vectors:
            self._drop_oldest()

    def waiting_in(self, lane: str) -> int:
        """How many posts of a kind, of all vehicles, have no final answer."""
        lanes = (each for (_, name), each in self._lanes.items() if name == lane)
        return sum(len(each.posts) + (each.in_flight is not None) for each in lanes)

    def take(self, now: float) -> Post | None:
        """Give the most urgent post that is ready; it is in flight until its outcome is known."""
        due = ((lane, self._place_due(lane, now)) for lane in self._all)
        ready = [(lane, place) for lane, place in due if place is not None]
        if not ready:
            return None
        self._turns += 1
        if self._turns % LONGEST_WAITING_EVERY == 0:
            lane, place = min(ready, key=lambda each: each[0].taken_at)
        else:
            lane, place = min(ready, key=lambda each: (self._urgency_of(each[0]), each[0].taken_at))
        lane.taken_at = now
        return lane.take(place)

    def _urgency_of(self, lane: _Lane) -> Urgency:
        """Urgency of a lane; the description of a vehicle that is registered is telemetry."""
        is_known = lane.urgency is Urgency.REGISTRATION and lane.vehicle_id in self._registered
        return Urgency.TELEMETRY if is_known else lane.urgency

    def next_due(self) -> float | None:
        """When the next waiting post may be tried; None when no post waits."""
        return min((due for lane in self._all for _, due in self._candidates(lane)), default=None)

    def is_in_flight(self, post: Post) -> bool:
        """Whether a post was taken and its outcome is not known yet."""
        return self._lanes[post.vehicle_id, post.lane].in_flight is post

    def answered(self, post: Post) -> None:
        """Remove a post that has its final answer.

        The edge server is reachable again, so lanes that waited only for that become ready.
        """
        if post.spool_number is not None:
            self._released.add(post.spool_number)
        self._close(post)

    def refused(self, post: Post, reason: str) -> bool:
        """Remove a post that would be refused again; whether it becomes a dead letter.

        A post that the next run can send anew does not, nor does an acceptance.
        """
        self._close(post)
        return self._discard(post, reason)

    def _close(self, post: Post) -> None:
        lane = self._lanes[post.vehicle_id, post.lane]
        if lane.posts_ahead == 0:
            lane.result_not_before = None
        lane.close()
        lane.attempts = 0
        self._answers += 1
        self._note_removed(post)
        for other in self._all:
            if other is lane or other.is_unreachable:
                other.failures = 0
                other.is_unreachable = False
                other.not_before = 0.0

    def failed(
        self,
        post: Post,
        now: float,
        *,
        is_unreachable: bool,
        is_temporary: bool = False,
        lacks_space: bool = False,
        reason: str = "",
    ) -> bool:
        """Put a post back to its place in its lane, to be tried again after a pause.

        `is_unreachable`: the edge server gave no answer, rather than a refusal; `is_temporary`: it
        refuses until a condition outside the request changes, such as a full disk; `lacks_space`:
        this condition is that it has no space for the post, so that reports and acknowledgements
        go past a result. Returns whether the post was given up instead.
        """
        lane = self._lanes[post.vehicle_id, post.lane]
        lane.is_unreachable = is_unreachable
        if self._count_failure(post, lane, is_temporary=is_temporary):
            lane.close()
            self._give_up(post, lane, reason)
            return True
        if post.replaces and lane.posts:
            lane.close()
        else:
            lane.put_back()
        if post.is_result and lacks_space:
            lane.result_not_before = now + self._pause_s(LONGEST_PAUSE_S)
            return False
        lane.result_not_before = None
        ceiling = min(LONGEST_PAUSE_S, FIRST_PAUSE_S * 2**lane.failures)
        lane.failures = min(lane.failures + 1, 16)
        lane.not_before = now + self._pause_s(ceiling)
        return False

    def _pause_s(self, longest_s: float) -> float:
        return self._jitter.uniform(longest_s / 2, longest_s)

    def _count_failure(self, post: Post, lane: _Lane, *, is_temporary: bool) -> bool:
        """Count a failure that is the post's own; whether it was the last one."""
        others_answered = self._answers > max(post.answers_before, lane.answers_before)
        post.answers_before = lane.answers_before = self._answers
        if others_answered and not is_temporary:
            post.attempts += 1
            lane.attempts += 1
        return max(post.attempts, lane.attempts if post.replaces else 0) >= MAX_ATTEMPTS

    def _give_up(self, post: Post, lane: _Lane, reason: str) -> None:
        """Remove a post from its lane, so that the posts behind it are sent."""
        lane.failures = lane.attempts = 0
        lane.result_not_before = None
        lane.is_unreachable = False
        lane.not_before = 0.0
        self._note_removed(post)
        self._discard(post, reason)

    def _note_removed(self, post: Post) -> None:
        """End the wait for a post: of reports for a registration, of work for a report.

        A vehicle's reports are also tried without a registration that was given up.
        """
        self._inherited_reports[post.vehicle_id] -= post.is_inherited_report
        if post.urgency is Urgency.REGISTRATION:
            self._registered.add(post.vehicle_id)

    def _discard(self, post: Post, reason: str) -> bool:
        """Keep a post that is not sent again as a dead letter, or drop it; whether it is kept."""
        if post.must_survive and not post.is_acceptance:
            self._dead_letters.append(DeadLetter(post, reason))
            return True
        self.dropped += not post.must_survive
        if post.spool_number is not None:
            self._released.add(post.spool_number)
        return False

    def take_dead_letters(self) -> list[DeadLetter]:
        """Give the dead letters since the last call."""
        letters = list(self._dead_letters)
        self._dead_letters.clear()
        return letters

    def dead_letters_of(self, vehicle_id: int) -> int:
        """How many dead letters of a vehicle have not been taken."""
        return sum(letter.post.vehicle_id == vehicle_id for letter in self._dead_letters)

    def release(self, number: int) -> None:
        """Mark the number of a post in the spool as released: the post is stored elsewhere."""
        self._released.add(number)

    @property
    def vehicles_with_unsent_reports(self) -> frozenset[int]:
        """Vehicles with reports of an earlier run that the edge server has not answered."""
        return frozenset(
            vehicle_id for vehicle_id, count in self._inherited_reports.items() if count
        )

    def unsent_reports_of(self, vehicle_id: int) -> int:
        """How many of them a vehicle has."""
        return self._inherited_reports[vehicle_id]

    @property
    def has_failures(self) -> bool:
        """Whether any lane has failed and was not answered since."""
        return any(lane.has_failed for lane in self._all)

    def at_risk(self, now: float, *, reports: bool = True, pictures: bool = True) -> list[Post]:
        """Give the posts that would be lost with the broker and may wait long; lanes in order.

        These are the posts of a lane whose first post has failed, those that wait for a
        registration that has failed, and all posts while the edge server is unreachable. The most
        urgent lanes come first.

        Args:
            now: [s]
            reports: include everything but pictures.
            pictures: include pictures.
        """
        lanes = self._all
        is_unreachable = any(lane.is_unreachable or lane.is_slow(now) for lane in lanes)
        unregistered = {
            lane.vehicle_id
            for lane in lanes
            if lane.urgency is Urgency.REGISTRATION and lane.failures
        } - self._registered
        return _unspooled(
            lane
            for lane in lanes
            if (is_unreachable or lane.has_failed or lane.vehicle_id in unregistered)
            and (pictures if lane.urgency is Urgency.PICTURE else reports)
        )

    def unspooled(self) -> list[Post]:
        """Give every post that would be lost with the broker, in the same order."""
        return _unspooled(self._all)

    def take_released(self) -> frozenset[int]:
        """Give the numbers in the spool that have been released since the last call."""
        released, self._released = frozenset(self._released), set()
        return released

    def mark_unspooled(self, numbers: Collection[int]) -> None:
        """Mark the posts of these numbers as not in the spool."""
        for lane in self._all:
            for post in lane.all():
                if post.spool_number in numbers:
                    post.spool_number = None

    @property
    def _all(self) -> list[_Lane]:
        return list(self._lanes.values())

    def _place_due(self, lane: _Lane, now: float) -> int | None:
        """Give the place of the post that is next in a lane; None if none may be sent now."""
        return next((place for place, due in self._candidates(lane) if now >= due), None)

    def _candidates(self, lane: _Lane) -> Iterator[tuple[int, float]]:
        for place, due in lane.candidates():
            needs_registration = lane.posts[place].needs_registration
            if not needs_registration or lane.vehicle_id in self._registered:
                yield place, due

    def _droppable(self) -> int:
        return sum(len(lane.posts) for lane in self._all if self._may_drop(lane))

    def _drop_oldest(self) -> None:
        longest = max(
            (lane for lane in self._all if self._may_drop(lane)), key=lambda lane: len(lane.posts)
        )
        longest.posts.popleft()
        self.dropped += 1

    @staticmethod
    def _may_drop(lane: _Lane) -> bool:
        return bool(lane.posts) and lane.posts[0].may_be_dropped


def _unspooled(lanes: Iterable[_Lane]) -> list[Post]:
    by_urgency = sorted(lanes, key=lambda lane: lane.urgency)
    return [post for lane in by_urgency for post in lane.unspooled()]
