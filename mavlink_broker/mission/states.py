"""The states of one vehicle's mission, and every transition from one to another: one table.

    IDLE --MISSION_TAKEN--> WAITING --READY--> PLACING_GEOFENCE --GEOFENCE_PLACED--> UPLOADING
    PLACING_GEOFENCE --IN_AIR--> HOLDING --HELD--> UPLOADING --STORED--> VERIFYING
    VERIFYING --VERIFIED--> SELECTING --SELECTED--> ARMING --ARMED--> STARTING --FLYING--> RUNNING
    RUNNING --LIVE_NEXT--> FLYING_LIVE --ITEMS_NEXT--> HOLDING
    FLYING_LIVE --GROUND_NEXT--> WAITING
    IDLE --MISSION_RESUMED--> ATTACHING --FLYING--> RUNNING
    ATTACHING --NOT_STARTED--> WAITING

A mission also leaves these states by five events that may occur in many of them:

    ENDED              to IDLE: the mission has its terminal status
    FAULT              to FAILING, and from there by ENDED
    ABORTED            to ABORTING, and from there by ENDED
    LINK_LOST          to ATTACHING, out of a state that needs the vehicle's answers
    VEHICLE_RESTARTED  to WAITING, before the vehicle flies

IllegalTransitionError  a state does not know the event; nothing has changed
"""

from collections.abc import Mapping
from enum import Enum, auto
from typing import Final


class State(Enum):
    """What the broker does for the mission of one vehicle."""

    IDLE = auto()  # No mission, or one that waits until the vehicle has landed
    ATTACHING = auto()  # Finds out what the vehicle has made of a mission meanwhile
    WAITING = auto()  # Waits until the vehicle is connected, has a position, is ready to arm
    PLACING_GEOFENCE = auto()  # The plan's geofence goes onto the vehicle before it may fly
    HOLDING = auto()  # A hovering vehicle leaves its mission mode before items arrive
    UPLOADING = auto()  # The items go onto the vehicle
    VERIFYING = auto()  # The vehicle proves that it holds the items
    SELECTING = auto()  # The first item becomes the current one
    ARMING = auto()
    STARTING = auto()  # The start is ordered, no heartbeat has shown the flight
    RUNNING = auto()  # The vehicle flies items; progress is reported
    FLYING_LIVE = auto()  # The broker flies a command live, between segments of items
    ABORTING = auto()  # The vehicle is sent away; an aborted mission ends when it obeys
    FAILING = auto()  # A fault has ended the mission; the vehicle may send its reasons


PREPARING: Final = frozenset(
    {
        State.PLACING_GEOFENCE,
        State.HOLDING,
        State.UPLOADING,
        State.VERIFYING,
        State.SELECTING,
        State.ARMING,
        State.STARTING,
    }
)
"""States of a mission, or of a segment of it, that is transferred to its vehicle and started."""
ASKING: Final = PREPARING | {State.FLYING_LIVE}
"""States that need the vehicle's answers: a link that is away shows as a refusal."""
ARMED_BY_BROKER: Final = frozenset({State.ARMING, State.STARTING})
TRANSFERRING: Final = PREPARING - ARMED_BY_BROKER
"""States in which a mission that expires is not flown any more: nothing was ordered to move."""
UPLOADED: Final = frozenset({State.VERIFYING, State.SELECTING, State.ARMING, State.STARTING})
"""The items are on the vehicle, which does not fly them yet."""
IN_FLIGHT: Final = frozenset({State.RUNNING, State.FLYING_LIVE})
READING: Final = frozenset({State.ATTACHING, State.RUNNING})
"""States that order nothing, so that they go on while another system is in command."""
WITH_ITEMS: Final = PREPARING - {State.PLACING_GEOFENCE, State.HOLDING}
"""States in which the items of a segment are transferred to the vehicle or stored on it."""
ENDING: Final = frozenset({State.ABORTING, State.FAILING, State.IDLE})
"""States in which no order of the mission is given any more."""


class Event(Enum):
    """What moves a mission on."""

    MISSION_TAKEN = auto()
    MISSION_RESUMED = auto()  # An earlier run of the broker accepted it
    FLYING = auto()
    NOT_STARTED = auto()
    READY = auto()
    GEOFENCE_PLACED = auto()
    IN_AIR = auto()  # The geofence is placed, and the vehicle hovers where a mission left it
    HELD = auto()
    REFUSED = auto()  # An item, for which there is another one
    STORED = auto()
    VERIFIED = auto()
    SELECTED = auto()
    ARMED = auto()
    LIVE_NEXT = auto()  # The next command is flown live
    ITEMS_NEXT = auto()  # The next commands are mission items, and the vehicle is in the air
    GROUND_NEXT = auto()  # The next commands begin with a take-off
    LINK_LOST = auto()  # No answer while the link was lost: find out whether the order took effect
    VEHICLE_RESTARTED = auto()  # On the ground, before it flew: begin again
    ABORTED = auto()  # By an event or an alarm, in the air
    FAULT = auto()
    ENDED = auto()  # The mission has its terminal status


_FROM_GROUND: Final = PREPARING - {State.HOLDING}
"""A vehicle that holds in the air fails when it restarts."""

TRANSITIONS: Final[Mapping[tuple[State, Event], State]] = {
    (State.IDLE, Event.MISSION_TAKEN): State.WAITING,
    (State.IDLE, Event.MISSION_RESUMED): State.ATTACHING,
    (State.ATTACHING, Event.FLYING): State.RUNNING,
    (State.ATTACHING, Event.NOT_STARTED): State.WAITING,
    (State.ATTACHING, Event.LIVE_NEXT): State.FLYING_LIVE,
    (State.ATTACHING, Event.ITEMS_NEXT): State.HOLDING,
    (State.ATTACHING, Event.GROUND_NEXT): State.WAITING,
    (State.WAITING, Event.READY): State.PLACING_GEOFENCE,
    (State.PLACING_GEOFENCE, Event.GEOFENCE_PLACED): State.UPLOADING,
    (State.PLACING_GEOFENCE, Event.IN_AIR): State.HOLDING,
    (State.PLACING_GEOFENCE, Event.LIVE_NEXT): State.FLYING_LIVE,
    (State.HOLDING, Event.HELD): State.UPLOADING,
    (State.UPLOADING, Event.STORED): State.VERIFYING,
    (State.UPLOADING, Event.REFUSED): State.UPLOADING,
    (State.UPLOADING, Event.LIVE_NEXT): State.FLYING_LIVE,
    (State.VERIFYING, Event.VERIFIED): State.SELECTING,
    (State.SELECTING, Event.SELECTED): State.ARMING,
    (State.ARMING, Event.ARMED): State.STARTING,
    (State.STARTING, Event.FLYING): State.RUNNING,
    (State.RUNNING, Event.LIVE_NEXT): State.FLYING_LIVE,
    (State.RUNNING, Event.ITEMS_NEXT): State.HOLDING,
    (State.RUNNING, Event.GROUND_NEXT): State.WAITING,
    (State.FLYING_LIVE, Event.LIVE_NEXT): State.FLYING_LIVE,
    (State.FLYING_LIVE, Event.ITEMS_NEXT): State.HOLDING,
    (State.FLYING_LIVE, Event.GROUND_NEXT): State.WAITING,
    **{(state, Event.LINK_LOST): State.ATTACHING for state in ASKING},
    **{(state, Event.VEHICLE_RESTARTED): State.WAITING for state in _FROM_GROUND},
    **{
        (state, Event.FAULT): State.FAILING
        for state in State
        if state not in {State.IDLE, State.ABORTING, State.FAILING}
    },
    **{(state, Event.ABORTED): State.ABORTING for state in State if state is not State.IDLE},
    **{(state, Event.ENDED): State.IDLE for state in State if state is not State.IDLE},
}


class IllegalTransitionError(Exception):
    """A state does not know an event."""


def follow(state: State, event: Event) -> State:
    """Give the state after an event.

    Raises:
        IllegalTransitionError: if the table has no such transition.
    """
    try:
        return TRANSITIONS[state, event]
    except KeyError:
        raise IllegalTransitionError(f"{event.name} in {state.name}") from None
