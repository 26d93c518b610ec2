"""The life of an event: one table. Pure.

The status of its row of work says where it is, so that a state is never written twice.
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final

from afarcloud.enumerations import Status


class State(StrEnum):
    """Where an event is; the last three are ends."""

    QUEUED = "queued"
    ACCEPTED = "accepted"
    DONE = "done"
    REFUSED = "refused"
    EXPIRED = "expired"


class Happening(StrEnum):
    """What moves it."""

    ACCEPTED = "accepted"
    DONE = "done"
    REFUSED = "refused"
    TOO_LATE = "too late"


class IllegalTransitionError(Exception):
    """A happening that the state does not know; nothing has changed."""


TRANSITIONS: Final[Mapping[tuple[State, Happening], State]] = {
    (State.QUEUED, Happening.ACCEPTED): State.ACCEPTED,
    (State.QUEUED, Happening.DONE): State.DONE,
    (State.QUEUED, Happening.REFUSED): State.REFUSED,
    (State.QUEUED, Happening.TOO_LATE): State.EXPIRED,
    (State.ACCEPTED, Happening.ACCEPTED): State.ACCEPTED,  # Said twice
    (State.ACCEPTED, Happening.DONE): State.DONE,
    (State.ACCEPTED, Happening.REFUSED): State.REFUSED,
    (State.DONE, Happening.DONE): State.DONE,  # Said twice
    (State.REFUSED, Happening.REFUSED): State.REFUSED,  # Said twice
}
"""What is not here is a conflict: an event ends once."""

STATUS: Final[Mapping[State, Status]] = {
    State.QUEUED: Status.NOT_STARTED,
    State.ACCEPTED: Status.RUNNING,
    State.DONE: Status.FINISHED,
    State.REFUSED: Status.FAILED,
    State.EXPIRED: Status.ABORTED,
}
"""How a state is written in the row of work."""

_STATES: Final = {status: state for state, status in STATUS.items()}


def state_of(status_id: int) -> State:
    """Read a state from a row of work."""
    return _STATES[Status(status_id)]


def follow(state: State, happening: Happening) -> State:
    """Give the next state; raises IllegalTransitionError."""
    try:
        return TRANSITIONS[state, happening]
    except KeyError:
        raise IllegalTransitionError(f"an event that is {state} cannot be {happening}") from None
