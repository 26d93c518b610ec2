"""Kills of programs near changes: within a second behind one, often before it is answered.

A kill at any time meets the rare moments that matter once in many seeds. A seed draws which changes
count, and how often each is followed by the end of a program or the restart of a vehicle.
"""

from collections.abc import Callable
from typing import Final

from dst import changes
from dst.changes import Change
from dst.world import World
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
PROGRAMS: Final = ("broker", "edge server", "relay", "vehicle")
WEIGHTS: Final = (6, 2, 1, 3)
"""How often each is killed: what the broker holds in memory alone is most."""

Kill = Callable[[], None]


class ChangeKills:
    """Kills programs of a world near changes, until `stop`."""

    def __init__(self, world: World, kills: dict[str, Kill]) -> None:
        """`kills` ends each program that is up, by its name, and starts it again."""
        self._world = world
        self._kills = kills
        self._random = world.scheduler.random("kills at changes")
        self._rate = self._random.uniform(*RATES)
        count = self._random.randint(LEAST_CHANGES, len(Change))
        self._chosen = frozenset(self._random.sample(list(Change), count))
        self._rests_until_s = 0.0
        self._is_stopped = False
        world.on_frame = self._framed
        world.http.on_change = self._posted
        world.on_event = lambda: self._changed(Change.ACCEPTANCE, None)

    def stop(self) -> None:
        """Kill nothing more."""
        self._is_stopped = True

    def _framed(self, system: int, frame: bytes) -> None:
        self._changed(changes.of_frame(frame), system)

    def _posted(self, post: Post, answer: Answer) -> None:
        self._changed(changes.of_post(post, answer.status_code), post.vehicle_id)

    def _changed(self, change: Change | None, system: int | None) -> None:
        """Kill a program soon, or not; `system` is the vehicle that changes, None if any does."""
        now_s, random = self._world.scheduler.now_s, self._random
        if change not in self._chosen or self._is_stopped or now_s < self._rests_until_s:
            return
        share = UPLOAD_SHARE if change is Change.UPLOAD else 1.0
        if random.random() >= self._rate * share:
            return
        self._rests_until_s = now_s + REST_S
        longest_s = AT_ONCE_S if random.random() < AT_ONCE_SHARE else WITHIN_S
        (program,) = random.choices(PROGRAMS, WEIGHTS)
        vehicles = list(self._world.vehicles)
        vehicle = system if system in vehicles else random.choice(vehicles)
        self._world.scheduler.note("faults", program, f"is killed soon, at {change}")
        delay_s = random.uniform(0.0, longest_s)
        self._world.scheduler.after(delay_s, lambda: self._kill(program, vehicle))

    def _kill(self, program: str, system: int) -> None:
        if self._is_stopped:
            return
        if program != "vehicle":
            self._kills[program]()
            return
        vehicle = self._world.vehicles[system]
        if vehicle.is_on:
            self._world.scheduler.note("faults", f"vehicle {system}", "reboot at a change")
            vehicle.reboot()
