"""A datagram network that loses, doubles, delays, reorders and corrupts, and that may be down."""

from collections.abc import Callable
from dataclasses import dataclass
from random import Random

from dst.scheduler import Scheduler


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """How often a datagram suffers what, as probabilities, and how long it takes [s]."""

    loss: float = 0.0
    duplication: float = 0.0
    corruption: float = 0.0
    delay_s: float = 0.005
    jitter_s: float = 0.0
    """Drawn for each datagram: one with a longer delay is overtaken by the next."""


PERFECT = Conditions()


class Path:
    """One direction between two parties."""

    def __init__(
        self,
        scheduler: Scheduler,
        name: str,
        deliver: Callable[[bytes], None],
        conditions: Conditions = PERFECT,
    ) -> None:
        """Deliver to a receiver; `name` selects the source of random numbers."""
        self._scheduler = scheduler
        self._random = scheduler.random(f"network/{name}")
        self._deliver = deliver
        self.conditions = conditions
        self._is_up = True
        self.changed_s = 0.0  # When it last went down or came up

    @property
    def is_up(self) -> bool:
        """Whether anything is delivered."""
        return self._is_up

    @is_up.setter
    def is_up(self, is_up: bool) -> None:
        if is_up != self._is_up:
            self._is_up, self.changed_s = is_up, self._scheduler.now_s

    def send(self, datagram: bytes) -> None:
        """Send a datagram, which may arrive never, once, or more often."""
        conditions, random = self.conditions, self._random
        if not self.is_up or random.random() < conditions.loss:
            return
        copies = 2 if random.random() < conditions.duplication else 1
        for _ in range(copies):
            data = datagram
            if random.random() < conditions.corruption:
                data = corrupt(datagram, random)
            delay_s = conditions.delay_s + random.uniform(0.0, conditions.jitter_s)
            self._scheduler.after(delay_s, lambda data=data: self._arrive(data))  # type: ignore[misc]  # the default binds this copy

    def _arrive(self, datagram: bytes) -> None:
        """Hand over a datagram, unless the network has gone down meanwhile."""
        if self.is_up:
            self._deliver(datagram)


def corrupt(datagram: bytes, random: Random) -> bytes:
    """Change one bit, or cut the datagram off."""
    place = random.randrange(len(datagram))
    if random.random() < 0.5:
        return datagram[:place]
    changed = bytearray(datagram)
    changed[place] ^= 1 << random.randrange(8)
    return bytes(changed)
