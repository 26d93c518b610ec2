"""What waits to be sent to the edge server, and whose turn it is. Pure: no thread, no network.

Order is kept per lane: one lane per vehicle and kind, one for a mission's reports together with
the acknowledgements of its work. A lane whose head failed waits out its own back-off. A vehicle's
reports wait until the edge server has answered its registration.

When the edge server is away for long, the oldest state vectors are dropped and counted, and a
newer description of a vehicle replaces the one that waits. Everything else is kept, and given to
whoever puts it onto the disk: what has failed once, and what waits behind it.

A post that is refused for good, or fails again and again, is given up, so that what waits behind
it is sent; it becomes a dead letter. The latter takes 20 failures. A failure counts only if the
edge server has given a final answer to something else since the failure before: while it is away,
or fails for everybody, nothing is given up. What it refuses for now on purpose (`waits` in
`failed`) does not count either.
"""

import random
from collections import Counter, deque
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import takewhile
from typing import Any, Final

STATE_VECTORS_KEPT: Final = 3600
"""An hour of one vehicle; some 2 MB."""
FIRST_PAUSE_S: Final = 0.2
LONGEST_PAUSE_S: Final = 5.0
MOST_ATTEMPTS: Final = 20
"""Failures of one post while others were answered: more than a minute."""
DEAD_KEPT: Final = 1000
"""Posts that were given up and wait to be taken onto the disk; without a disk the newest."""
SLOW_AFTER_S: Final = 3.0
"""An edge server that has not answered by then may be none."""


class Urgency(IntEnum):
    """Which lane goes first when several could."""

    REGISTRATION = 0
    ALARM = 1
    REPORT = 2
    RESULT = 3
    TELEMETRY = 4
    PICTURE = 5


@dataclass(slots=True, kw_only=True)
class Post:
    """One request that has to be answered."""

    method: str
    path: str
    body: dict[str, Any]
    vehicle_id: int
    lane: str
    urgency: Urgency
    idempotency_key: str | None = None
    needs_registration: bool = True
    may_be_dropped: bool = False
    may_be_known: bool = False  # Told before a crash, perhaps: then the first telling stands
    replaces: bool = False  # A newer one of the same lane makes it obsolete
    kept_as: int | None = None  # Its number on the disk, where it is there
    is_inherited: bool = False  # From an earlier run of the broker
    accepts: int | None = None  # The work that it accepts: what is answered decides
    attempts: int = 0  # Failures of its own, while others were answered
    answers_before: int = 0  # How many others had been answered at its last failure

    @property
    def is_worth_keeping(self) -> bool:
        """Whether it must survive the broker: what the next run can tell anew must not."""
        return not (self.may_be_dropped or self.replaces)

    @property
    def is_owed(self) -> bool:
        """Whether the edge server knows less than the broker did, until it is told."""
        return self.is_inherited and self.urgency is Urgency.REPORT


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
    taken_at: float = 0.0
    failures: int = 0
    cut_off: bool = False  # The last failure was an edge server that was not there
    not_before: float = 0.0
    attempts: int = 0  # As of a post: of lanes in which a newer post replaces the one that failed
    answers_before: int = 0

    def is_slow(self, now: float) -> bool:
        """Whether an answer is overdue."""
        return self.in_flight is not None and now - self.taken_at > SLOW_AFTER_S

    def all(self) -> Iterator[Post]:
        """Everything without an answer, in order."""
        if self.in_flight is not None:
            yield self.in_flight
        yield from self.posts

    def unkept(self) -> list[Post]:
        """What should be on the disk and is not; all that is there comes before it."""
        first = next(self.all(), None)
        if first is None or not first.is_worth_keeping:
            return []
        tail = list(takewhile(lambda post: post.kept_as is None, reversed(self.posts)))
        if self.in_flight is not None and self.in_flight.kept_as is None:
            tail.append(self.in_flight)
        return tail[::-1]


class SendQueue:
    """Lanes of posts; the caller sends the one that `take` gives and says how it went."""

    def __init__(self, jitter: random.Random, *, kept: int = STATE_VECTORS_KEPT) -> None:
        self._jitter = jitter
        self._kept = kept
        self._lanes: dict[tuple[int, str], _Lane] = {}
        self._registered: set[int] = set()
        self._settled: set[int] = set()
        self._owed: Counter[int] = Counter()
        self._answers = 0
        self._dead: deque[DeadLetter] = deque(maxlen=DEAD_KEPT)
        self.dropped = 0

    def __len__(self) -> int:
        return sum(len(lane.posts) + (lane.in_flight is not None) for lane in self._all)

    def put(self, post: Post) -> None:
        """Line a post up behind those of its lane."""
        key = post.vehicle_id, post.lane
        lane = self._lanes.setdefault(key, _Lane(post.urgency, post.vehicle_id))
        if post.replaces:
            lane.posts.clear()
        lane.posts.append(post)
        self._owed[post.vehicle_id] += post.is_owed
        if post.may_be_dropped and self._droppable() > self._kept:
            self._drop_oldest()

    def waiting_in(self, lane: str) -> int:
        """How many posts of a kind, of all vehicles, have not been answered."""
        lanes = (each for (_, name), each in self._lanes.items() if name == lane)
        return sum(len(each.posts) + (each.in_flight is not None) for each in lanes)

    def take(self, now: float) -> Post | None:
        """Give the most urgent post whose turn it is; it is in flight until settled."""
        ready = [lane for lane in self._all if self._is_ready(lane, now)]
        if not ready:
            return None
        lane = min(ready, key=lambda candidate: candidate.urgency)
        lane.in_flight, lane.taken_at = lane.posts.popleft(), now
        return lane.in_flight

    def next_due(self) -> float | None:
        """When the next waiting post may be tried; None when nothing waits."""
        return min((lane.not_before for lane in self._all if self._may_go(lane)), default=None)

    def is_in_flight(self, post: Post) -> bool:
        """Whether a post that was taken has not been settled yet."""
        return self._lanes[post.vehicle_id, post.lane].in_flight is post

    def answered(self, post: Post) -> None:
        """Settle a post that has its final answer.

        The edge server is there again, so lanes that waited only for that wait no more.
        """
        if post.kept_as is not None:
            self._settled.add(post.kept_as)
        self._close(post)

    def refused(self, post: Post, reason: str) -> bool:
        """Settle a post that would be refused again; whether it is a dead letter from now on.

        What the next run can report anew is none.
        """
        if not post.is_worth_keeping:
            self.dropped += 1
            self.answered(post)
            return False
        self._close(post)
        self._dead.append(DeadLetter(post, reason))
        return True

    def _close(self, post: Post) -> None:
        lane = self._lanes[post.vehicle_id, post.lane]
        lane.in_flight = None
        lane.attempts = 0
        self._answers += 1
        self._owed[post.vehicle_id] -= post.is_owed
        if post.urgency is Urgency.REGISTRATION:
            self._registered.add(post.vehicle_id)
        for other in self._all:
            if other is lane or other.cut_off:
                other.failures = 0
                other.cut_off = False
                other.not_before = 0.0

    def failed(
        self, post: Post, now: float, *, cut_off: bool, waits: bool = False, reason: str = ""
    ) -> bool:
        """Put a post back to the head of its lane, to be tried again after a while.

        `cut_off` says that the edge server was not there, rather than that it refused for now;
        `waits` that it refused on purpose until something changes, such as a full disk. Gives
        whether the post was given up instead.
        """
        lane = self._lanes[post.vehicle_id, post.lane]
        lane.in_flight = None
        lane.cut_off = cut_off
        if self._counts(post, lane, waits=waits):
            self._give_up(post, lane, reason)
            return True
        if not (post.replaces and lane.posts):
            lane.posts.appendleft(post)
        ceiling = min(LONGEST_PAUSE_S, FIRST_PAUSE_S * 2**lane.failures)
        lane.failures = min(lane.failures + 1, 16)
        lane.not_before = now + self._jitter.uniform(ceiling / 2, ceiling)
        return False

    def _counts(self, post: Post, lane: _Lane, *, waits: bool) -> bool:
        """Count a failure that is the post's own; whether it was the last one."""
        others_answered = self._answers > max(post.answers_before, lane.answers_before)
        post.answers_before = lane.answers_before = self._answers
        if others_answered and not waits:
            post.attempts += 1
            lane.attempts += 1
        return max(post.attempts, lane.attempts if post.replaces else 0) >= MOST_ATTEMPTS

    def _give_up(self, post: Post, lane: _Lane, reason: str) -> None:
        """Take a post out of its lane; what waits behind it goes on."""
        lane.failures = lane.attempts = 0
        lane.cut_off = False
        lane.not_before = 0.0
        self._owed[post.vehicle_id] -= post.is_owed
        if post.urgency is Urgency.REGISTRATION:
            self._registered.add(post.vehicle_id)  # Its reports are tried without it
        if post.may_be_dropped or post.replaces:
            self.dropped += 1
        else:
            self._dead.append(DeadLetter(post, reason))

    def take_dead(self) -> list[DeadLetter]:
        """Give the posts that were given up since this was asked."""
        dead = list(self._dead)
        self._dead.clear()
        return dead

    def dead_of(self, vehicle_id: int) -> int:
        """How many posts of a vehicle were given up and have not been taken."""
        return sum(letter.post.vehicle_id == vehicle_id for letter in self._dead)

    def settle(self, number: int) -> None:
        """Take that what has this number on the disk is kept elsewhere."""
        self._settled.add(number)

    @property
    def owing(self) -> frozenset[int]:
        """Vehicles of which an earlier run knew more than the edge server has been told."""
        return frozenset(vehicle_id for vehicle_id, count in self._owed.items() if count)

    @property
    def is_in_trouble(self) -> bool:
        """Whether anything has failed and has not been answered since."""
        return any(lane.failures for lane in self._all)

    def endangered(self, now: float, *, words: bool = True, pictures: bool = True) -> list[Post]:
        """Give what would be lost with the broker and may wait for long; each lane in order.

        That is a lane whose head has failed, what waits for a registration that has failed, and
        everything while the edge server is not there. The most urgent lanes come first.
        """
        lanes = self._all
        is_away = any(lane.cut_off or lane.is_slow(now) for lane in lanes)
        strangers = {
            lane.vehicle_id
            for lane in lanes
            if lane.urgency is Urgency.REGISTRATION and lane.failures
        } - self._registered
        return _unkept(
            lane
            for lane in lanes
            if (is_away or lane.failures or lane.vehicle_id in strangers)
            and (pictures if lane.urgency is Urgency.PICTURE else words)
        )

    def unkept(self) -> list[Post]:
        """Give everything that would be lost with the broker, likewise."""
        return _unkept(self._all)

    def take_settled(self) -> frozenset[int]:
        """Give the numbers on the disk that have been answered since this was asked."""
        settled, self._settled = frozenset(self._settled), set()
        return settled

    def unkeep(self, numbers: Collection[int]) -> None:
        """Learn that these are not on the disk."""
        for lane in self._all:
            for post in lane.all():
                if post.kept_as in numbers:
                    post.kept_as = None

    @property
    def _all(self) -> list[_Lane]:
        return list(self._lanes.values())

    def _is_ready(self, lane: _Lane, now: float) -> bool:
        return self._may_go(lane) and now >= lane.not_before

    def _may_go(self, lane: _Lane) -> bool:
        if not lane.posts or lane.in_flight is not None:
            return False
        return not lane.posts[0].needs_registration or lane.vehicle_id in self._registered

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


def _unkept(lanes: Iterable[_Lane]) -> list[Post]:
    in_turn = sorted(lanes, key=lambda lane: lane.urgency)
    return [post for lane in in_turn for post in lane.unkept()]
