"""What waits to be told to the edge server, and whose turn it is. Pure: no thread, no network.

Order is kept per lane: one lane per vehicle and kind, one for a mission's reports together with
the acknowledgements of its work. A lane whose head failed waits out its own back-off. A vehicle's
reports wait until the edge server has answered its registration.

When the edge server is away for long, the oldest state vectors are dropped and counted, and a
newer description of a vehicle replaces the one that waits. Everything else is kept.
"""

import random
from collections import deque
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Final

STATE_VECTORS_KEPT: Final = 3600
"""An hour of one vehicle; some 2 MB."""
FIRST_PAUSE_S: Final = 0.2
LONGEST_PAUSE_S: Final = 5.0


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


@dataclass(slots=True)
class _Lane:
    urgency: Urgency
    vehicle_id: int
    posts: deque[Post] = field(default_factory=deque)
    in_flight: Post | None = None
    failures: int = 0
    cut_off: bool = False  # The last failure was an edge server that was not there
    not_before: float = 0.0


class SendQueue:
    """Lanes of posts; the caller sends the one that `take` gives and says how it went."""

    def __init__(self, jitter: random.Random, *, kept: int = STATE_VECTORS_KEPT) -> None:
        self._jitter = jitter
        self._kept = kept
        self._lanes: dict[tuple[int, str], _Lane] = {}
        self._registered: set[int] = set()
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
        lane.in_flight = lane.posts.popleft()
        return lane.in_flight

    def next_due(self) -> float | None:
        """When the next waiting post may be tried; None when nothing waits."""
        return min((lane.not_before for lane in self._all if self._may_go(lane)), default=None)

    def answered(self, post: Post) -> None:
        """Settle a post that has its final answer.

        The edge server is there again, so lanes that waited only for that wait no more.
        """
        lane = self._lanes[post.vehicle_id, post.lane]
        lane.in_flight = None
        if post.urgency is Urgency.REGISTRATION:
            self._registered.add(post.vehicle_id)
        for other in self._all:
            if other is lane or other.cut_off:
                other.failures = 0
                other.cut_off = False
                other.not_before = 0.0

    def failed(self, post: Post, now: float, *, cut_off: bool) -> None:
        """Put a post back to the head of its lane, to be tried again after a while.

        `cut_off` says that the edge server was not there, rather than that it refused for now.
        """
        lane = self._lanes[post.vehicle_id, post.lane]
        lane.in_flight = None
        lane.cut_off = cut_off
        if not (post.replaces and lane.posts):
            lane.posts.appendleft(post)
        ceiling = min(LONGEST_PAUSE_S, FIRST_PAUSE_S * 2**lane.failures)
        lane.failures = min(lane.failures + 1, 16)
        lane.not_before = now + self._jitter.uniform(ceiling / 2, ceiling)

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
