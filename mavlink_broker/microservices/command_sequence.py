"""Commands one after the other, with other ways to the same end when one is refused."""

from collections.abc import Sequence
from typing import TypeAlias

from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.microservices.command import (
    Accepted,
    Command,
    CommandOutcome,
    CommandTransaction,
    Refused,
)
from mavlink_broker.microservices.round_trip import RoundTrip

Ways: TypeAlias = Sequence[Sequence[Command]]
"""Each way is a list of commands that must all be accepted; ways are tried in order."""


class CommandSequence:
    """Goes the first way on which every command is accepted.

    When no way is left, the reason of the first refusal is the outcome: it belongs to the way
    that was meant.
    """

    def __init__(
        self, ways: Ways, route: Route, round_trip: RoundTrip, *, said_before: bool = False
    ) -> None:
        self._said_before = said_before
        self._steps = [list(way) for way in ways]
        self._route = route
        self._round_trip = round_trip
        self._running: CommandTransaction | None = None
        self._first_refusal: Refused | None = None
        self.way = 0  # That is being gone, or was gone
        self.outcome: CommandOutcome | None = None

    @property
    def is_in_progress(self) -> bool:
        """Whether the vehicle works on the command that it was told last."""
        return self._running is not None and self._running.is_in_progress

    def start(self, now: float) -> list[Message]:
        """Send the first command of the first way."""
        return self._next(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take an answer and send what follows from it."""
        if self.outcome is not None or self._running is None:
            return []
        return [*self._running.receive(message, now), *self._advance(now)]

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue."""
        if self.outcome is not None or self._running is None:
            return []
        return [*self._running.tick(now), *self._advance(now)]

    def _advance(self, now: float) -> list[Message]:
        match self._running.outcome if self._running else None:
            case Accepted():
                return self._next(now)
            case Refused() as refusal:
                self._first_refusal = self._first_refusal or refusal
                del self._steps[0]
                self.way += 1
                return self._next(now)
            case _:
                return []

    def _next(self, now: float) -> list[Message]:
        if not self._steps:
            self.outcome = self._first_refusal or Refused("this kind of vehicle knows no such way")
            return []
        if not self._steps[0]:
            self.outcome = Accepted()
            return []
        self._running = CommandTransaction(
            self._steps[0].pop(0), self._route, self._round_trip, said_before=self._said_before
        )
        return self._running.start(now)
