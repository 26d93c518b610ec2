"""Faults near changes: within a second behind one, often before it is answered.

A fault at any time meets the rare moments that matter once in many seeds. A seed draws which
changes count, and how often each is followed by the end of a program, the restart of a vehicle, or
the loss of its link.
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from dst.faults import changes
from dst.faults.changes import Change
from dst.world.world import World
from mavlink_broker.edge.bounded_http import Answer
from mavlink_broker.edge.outbox import Post

RATES: Final = 0.2, 0.8
"""How often a change is followed by a kill, of which a seed draws one."""
UPLOAD_SHARE: Final = 0.2
"""Of that rate: geofences are uploaded too, and repeated where a link loses."""
WITHIN_S: Final = 1.0
AT_ONCE_S: Final = 0.05
AT_ONCE_SHARE: Final = 0.5
"""Of the kills that come within so short a time: before an answer, or in the middle of one."""
REST_S: Final = 4.0
"""From one kill to the next, at least: a system that is always killed flies nothing."""
LEAST_CHANGES: Final = 2
"""Of which a seed has kills."""


class Blow(NamedTuple):
    """What comes near a change."""

    name: str
    weight: int
    """How often, of all of them."""
    strike: Callable[[int], None]
    """Takes the system id of the vehicle that changes."""


class ChangeFaults:
    """Strikes near changes of a world, until `stop`."""

    def __init__(self, world: World, name: str, blows: Sequence[Blow]) -> None:
        """`name` selects the source of random numbers."""
        self._world = world
        self._blows = blows
        self._random = world.scheduler.random(name)
        self._rate = self._random.uniform(*RATES)
        count = self._random.randint(LEAST_CHANGES, len(Change))
        self._chosen = frozenset(self._random.sample(list(Change), count))
        self._rests_until_s = 0.0
        self._is_stopped = False
        world.on_frame.append(self._framed)
        world.http.on_change.append(self._posted)
        world.on_event.append(lambda: self._changed(Change.ACCEPTANCE, None))

    def stop(self) -> None:
        """Strike no more."""
        self._is_stopped = True

    def _framed(self, system: int, frame: bytes) -> None:
        self._changed(changes.of_frame(frame), system)

    def _posted(self, post: Post, answer: Answer) -> None:
        self._changed(changes.of_post(post, answer.status_code), post.vehicle_id)

    def _changed(self, change: Change | None, system: int | None) -> None:
        """Strike soon, or not; `system` is the vehicle that changes, None if any does."""
        now_s, random = self._world.scheduler.now_s, self._random
        if change not in self._chosen or self._is_stopped or now_s < self._rests_until_s:
            return
        share = UPLOAD_SHARE if change is Change.UPLOAD else 1.0
        if random.random() >= self._rate * share:
            return
        self._rests_until_s = now_s + REST_S
        longest_s = AT_ONCE_S if random.random() < AT_ONCE_SHARE else WITHIN_S
        (blow,) = random.choices(self._blows, [one.weight for one in self._blows])
        vehicles = list(self._world.vehicles)
        vehicle = system if system in vehicles else random.choice(vehicles)
        self._world.scheduler.note("faults", blow.name, f"is struck soon, at {change}")
        delay_s = random.uniform(0.0, longest_s)
        self._world.scheduler.after(
            delay_s, lambda: None if self._is_stopped else blow.strike(vehicle)
        )
