"""Landed states and what changes them: one table.

    ON_GROUND --LIFT_OFF--> TAKEOFF --CLEAR--> IN_AIR --DESCEND--> LANDING
        TAKEOFF, IN_AIR, LANDING --TOUCH_DOWN or DISARM--> ON_GROUND
        LANDING --CLIMB--> IN_AIR

Every other pair of state and event changes nothing.
"""

from collections.abc import Mapping
from enum import IntEnum
from typing import Final

from uav_firmware.msg.status import LandedState


class LandEvent(IntEnum):
    """What the detector has seen."""

    DISARM = 0  # motors stopped: whatever was believed, this is the ground
    TOUCH_DOWN = 1  # all signs of standing have held for the trigger time
    LIFT_OFF = 2  # it moves up under thrust, or falls
    CLEAR = 3  # well above the place of lift-off
    DESCEND = 4  # a landing leads it down
    CLIMB = 5  # it is led up again


TRANSITIONS: Final[Mapping[tuple[LandedState, LandEvent], LandedState]] = {
    (LandedState.ON_GROUND, LandEvent.LIFT_OFF): LandedState.TAKEOFF,
    (LandedState.TAKEOFF, LandEvent.CLEAR): LandedState.IN_AIR,
    (LandedState.TAKEOFF, LandEvent.TOUCH_DOWN): LandedState.ON_GROUND,
    (LandedState.TAKEOFF, LandEvent.DISARM): LandedState.ON_GROUND,
    (LandedState.IN_AIR, LandEvent.DESCEND): LandedState.LANDING,
    (LandedState.IN_AIR, LandEvent.TOUCH_DOWN): LandedState.ON_GROUND,
    (LandedState.IN_AIR, LandEvent.DISARM): LandedState.ON_GROUND,
    (LandedState.LANDING, LandEvent.CLIMB): LandedState.IN_AIR,
    (LandedState.LANDING, LandEvent.TOUCH_DOWN): LandedState.ON_GROUND,
    (LandedState.LANDING, LandEvent.DISARM): LandedState.ON_GROUND,
}


def next_state(state: LandedState, event: LandEvent) -> LandedState:
    """State after an event; the same where the table has no entry."""
    return TRANSITIONS.get((state, event), state)
