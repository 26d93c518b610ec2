"""The states of an event: one table; pure.

    QUEUED --> ACCEPTED: accepted
    QUEUED --> DONE: done
    QUEUED --> REFUSED: refused
    QUEUED --> EXPIRED: too late
    ACCEPTED --> ACCEPTED: accepted
    ACCEPTED --> DONE: done
    ACCEPTED --> REFUSED: refused
    DONE --> DONE: done
    REFUSED --> REFUSED: refused

The state is stored as the status of the event's row of work, and nowhere else.
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final

from afarcloud.enumerations import Status
from edge_server.transitions import TransitionTable


class State(StrEnum):
    """State of an event; the last three are final."""

    QUEUED = "queued"
    ACCEPTED = "accepted"
    DONE = "done"
    REFUSED = "refused"
    EXPIRED = "expired"


class Trigger(StrEnum):
    """What changes the state of an event."""

    ACCEPTED = "accepted"
    DONE = "done"
    REFUSED = "refused"
    TOO_LATE = "too late"


EVENT_STATES: Final = TransitionTable(
    "an event",
    {
        (State.QUEUED, Trigger.ACCEPTED): State.ACCEPTED,
        (State.QUEUED, Trigger.DONE): State.DONE,
        (State.QUEUED, Trigger.REFUSED): State.REFUSED,
        (State.QUEUED, Trigger.TOO_LATE): State.EXPIRED,
        (State.ACCEPTED, Trigger.ACCEPTED): State.ACCEPTED,  # Repeated
        (State.ACCEPTED, Trigger.DONE): State.DONE,
        (State.ACCEPTED, Trigger.REFUSED): State.REFUSED,
        (State.DONE, Trigger.DONE): State.DONE,  # Repeated
        (State.REFUSED, Trigger.REFUSED): State.REFUSED,  # Repeated
    },
)
"""Any other transition is a conflict: an event ends once."""

STATUS: Final[Mapping[State, Status]] = {
    State.QUEUED: Status.NOT_STARTED,
    State.ACCEPTED: Status.RUNNING,
    State.DONE: Status.FINISHED,
    State.REFUSED: Status.FAILED,
    State.EXPIRED: Status.ABORTED,
}
"""How a state is stored in the row of work."""

_STATES: Final = {status: state for state, status in STATUS.items()}


def state_of(status_id: int) -> State:
    """Return the state that a row of work stores."""
    return _STATES[Status(status_id)]
