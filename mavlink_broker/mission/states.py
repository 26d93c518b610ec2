"""The states of one vehicle's session, and every way from one to another: one table.

IllegalTransitionError  an event that a state does not know; nothing has changed
"""

from collections.abc import Mapping
from enum import Enum, auto
from typing import Final


class State(Enum):
    """What the session is doing for its vehicle."""

    IDLE = auto()  # No mission, or one that waits for the vehicle to come down
    ATTACHING = auto()  # Finding out what the vehicle has made of a mission meanwhile
    WAITING = auto()  # A mission waits for the vehicle to be heard, placed and ready to arm
    FENCING = auto()  # The plan's geofence goes onto the vehicle, before it may fly
    HOLDING = auto()  # A hovering vehicle leaves its mission mode, lest it fly what arrives
    UPLOADING = auto()  # The mission goes onto the vehicle
    VERIFYING = auto()  # The vehicle proves that it holds the mission
    SELECTING = auto()  # The first item becomes the current one
    ARMING = auto()
    STARTING = auto()  # Told to start, not yet seen to fly
    RUNNING = auto()  # It flies; progress is followed and reported
    PERFORMING = auto()  # A command is flown live, between stretches of the mission
    LEAVING = auto()  # An event has ended the mission; the vehicle is told where to go
    FAILING = auto()  # Something was refused or went wrong; the vehicle may say why


BEFORE_TAKEOFF: Final = frozenset(
    {
        State.FENCING,
        State.HOLDING,
        State.UPLOADING,
        State.VERIFYING,
        State.SELECTING,
        State.ARMING,
        State.STARTING,
    }
)
"""States of a mission, or of a part of it, that is being given to its vehicle."""


class Event(Enum):
    """What moves a session on."""

    MISSION_TAKEN = auto()
    MISSION_RESUMED = auto()  # It was accepted by an earlier run of the broker
    FLYING = auto()
    NOT_STARTED = auto()
    READY = auto()
    HOVERS = auto()  # Ready, in the air where a mission of ours has left it
    FENCED = auto()
    HELD = auto()
    REFUSED = auto()  # An item, for which there is another one
    STORED = auto()
    VERIFIED = auto()
    SELECTED = auto()
    ARMED = auto()
    LIVE_NEXT = auto()  # The next command is flown live
    ITEMS_NEXT = auto()  # The next commands are mission items, and the vehicle is in the air
    GROUND_NEXT = auto()  # The next commands begin with a take-off
    UNHEARD = auto()  # Not answered while the link was away: what became of it is to be found out
    REBOOTED = auto()  # On the ground, before it flew: begin again
    ABORTED = auto()  # By an event, in the air
    FAULT = auto()
    ENDED = auto()  # The mission has its terminal status


TRANSITIONS: Final[Mapping[tuple[State, Event], State]] = {
    (State.IDLE, Event.MISSION_TAKEN): State.WAITING,
    (State.IDLE, Event.MISSION_RESUMED): State.ATTACHING,
    (State.ATTACHING, Event.FLYING): State.RUNNING,
    (State.ATTACHING, Event.NOT_STARTED): State.WAITING,
    (State.ATTACHING, Event.LIVE_NEXT): State.PERFORMING,
    (State.ATTACHING, Event.ITEMS_NEXT): State.HOLDING,
    (State.ATTACHING, Event.GROUND_NEXT): State.WAITING,
    (State.ATTACHING, Event.FAULT): State.FAILING,
    (State.WAITING, Event.READY): State.FENCING,
    (State.WAITING, Event.FAULT): State.FAILING,
    (State.WAITING, Event.ENDED): State.IDLE,
    (State.FENCING, Event.FENCED): State.UPLOADING,
    (State.FENCING, Event.HOVERS): State.HOLDING,
    (State.FENCING, Event.LIVE_NEXT): State.PERFORMING,
    (State.FENCING, Event.REBOOTED): State.WAITING,
    (State.FENCING, Event.UNHEARD): State.ATTACHING,
    (State.FENCING, Event.FAULT): State.FAILING,
    (State.HOLDING, Event.HELD): State.UPLOADING,
    (State.HOLDING, Event.UNHEARD): State.ATTACHING,
    (State.HOLDING, Event.FAULT): State.FAILING,
    (State.UPLOADING, Event.STORED): State.VERIFYING,
    (State.UPLOADING, Event.REBOOTED): State.WAITING,
    (State.UPLOADING, Event.REFUSED): State.UPLOADING,
    (State.UPLOADING, Event.LIVE_NEXT): State.PERFORMING,
    (State.UPLOADING, Event.UNHEARD): State.ATTACHING,
    (State.UPLOADING, Event.FAULT): State.FAILING,
    (State.VERIFYING, Event.VERIFIED): State.SELECTING,
    (State.VERIFYING, Event.REBOOTED): State.WAITING,
    (State.VERIFYING, Event.UNHEARD): State.ATTACHING,
    (State.VERIFYING, Event.FAULT): State.FAILING,
    (State.SELECTING, Event.SELECTED): State.ARMING,
    (State.SELECTING, Event.REBOOTED): State.WAITING,
    (State.SELECTING, Event.UNHEARD): State.ATTACHING,
    (State.SELECTING, Event.FAULT): State.FAILING,
    (State.ARMING, Event.ARMED): State.STARTING,
    (State.ARMING, Event.REBOOTED): State.WAITING,
    (State.ARMING, Event.UNHEARD): State.ATTACHING,
    (State.ARMING, Event.FAULT): State.FAILING,
    (State.STARTING, Event.FLYING): State.RUNNING,
    (State.STARTING, Event.REBOOTED): State.WAITING,
    (State.STARTING, Event.UNHEARD): State.ATTACHING,
    (State.STARTING, Event.FAULT): State.FAILING,
    (State.RUNNING, Event.ENDED): State.IDLE,
    (State.RUNNING, Event.LIVE_NEXT): State.PERFORMING,
    (State.RUNNING, Event.ITEMS_NEXT): State.HOLDING,
    (State.RUNNING, Event.GROUND_NEXT): State.WAITING,
    (State.RUNNING, Event.FAULT): State.FAILING,
    (State.PERFORMING, Event.LIVE_NEXT): State.PERFORMING,
    (State.PERFORMING, Event.ITEMS_NEXT): State.HOLDING,
    (State.PERFORMING, Event.GROUND_NEXT): State.WAITING,
    (State.PERFORMING, Event.ENDED): State.IDLE,
    (State.PERFORMING, Event.UNHEARD): State.ATTACHING,
    (State.PERFORMING, Event.FAULT): State.FAILING,
    (State.FAILING, Event.ENDED): State.IDLE,
    (State.ATTACHING, Event.ABORTED): State.LEAVING,
    (State.WAITING, Event.ABORTED): State.LEAVING,
    (State.FENCING, Event.ABORTED): State.LEAVING,
    (State.HOLDING, Event.ABORTED): State.LEAVING,
    (State.UPLOADING, Event.ABORTED): State.LEAVING,
    (State.VERIFYING, Event.ABORTED): State.LEAVING,
    (State.SELECTING, Event.ABORTED): State.LEAVING,
    (State.ARMING, Event.ABORTED): State.LEAVING,
    (State.STARTING, Event.ABORTED): State.LEAVING,
    (State.RUNNING, Event.ABORTED): State.LEAVING,
    (State.PERFORMING, Event.ABORTED): State.LEAVING,
    (State.FAILING, Event.ABORTED): State.LEAVING,
    (State.LEAVING, Event.ABORTED): State.LEAVING,
    (State.ATTACHING, Event.ENDED): State.IDLE,
    (State.FENCING, Event.ENDED): State.IDLE,
    (State.HOLDING, Event.ENDED): State.IDLE,
    (State.UPLOADING, Event.ENDED): State.IDLE,
    (State.VERIFYING, Event.ENDED): State.IDLE,
    (State.SELECTING, Event.ENDED): State.IDLE,
    (State.ARMING, Event.ENDED): State.IDLE,
    (State.STARTING, Event.ENDED): State.IDLE,
    (State.LEAVING, Event.ENDED): State.IDLE,
}


class IllegalTransitionError(Exception):
    """A state that does not know an event."""


def follow(state: State, event: Event) -> State:
    """Give the state after an event.

    Raises:
        IllegalTransitionError: if the table has no such step.
    """
    try:
        return TRANSITIONS[state, event]
    except KeyError:
        raise IllegalTransitionError(f"{event.name} in {state.name}") from None
