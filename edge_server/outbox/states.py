"""The life of an outbox row: one table.

A confirmed row is gone from the database together with its record. IN_FLIGHT is never written:
it is what the relay knows while it waits for an answer, so a crash leaves the row QUEUED and the
record is sent again under the same key.
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final


class State(StrEnum):
    """Where a row is."""

    QUEUED = "queued"
    IN_FLIGHT = "in flight"
    DEAD = "dead"
    GONE = "gone"


class Happening(StrEnum):
    """What moves it."""

    SENT = "sent"
    CONFIRMED = "confirmed"
    PUT_OFF = "put off"
    REFUSED = "refused"
    REJECTED = "rejected"
    CRASHED = "crashed"


class IllegalTransitionError(Exception):
    """A happening that the state does not know; nothing has changed."""


TRANSITIONS: Final[Mapping[tuple[State, Happening], State]] = {
    (State.QUEUED, Happening.SENT): State.IN_FLIGHT,
    (State.IN_FLIGHT, Happening.CONFIRMED): State.GONE,
    (State.IN_FLIGHT, Happening.PUT_OFF): State.QUEUED,
    (State.IN_FLIGHT, Happening.REFUSED): State.QUEUED,
    (State.IN_FLIGHT, Happening.REJECTED): State.DEAD,
    (State.IN_FLIGHT, Happening.CRASHED): State.QUEUED,
}


def follow(state: State, happening: Happening) -> State:
    """Give the next state; raises IllegalTransitionError."""
    try:
        return TRANSITIONS[state, happening]
    except KeyError:
        raise IllegalTransitionError(f"a row that is {state} cannot be {happening}") from None
