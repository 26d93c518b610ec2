"""Armed or not: the whole table. A pair that is not in it changes nothing and raises.

DISARMED --ARM_ACCEPTED--> ARMED
ARMED --DISARM_ACCEPTED | LANDED_TIMEOUT | PREFLIGHT_TIMEOUT | FAILSAFE | TERMINATED--> DISARMED
ARMED --CRASHED | MOTOR_FAILED_ON_GROUND--> DISARMED
"""

from collections.abc import Mapping
from enum import Enum, auto
from typing import Final


class Arming(Enum):
    """Whether the motors may turn."""

    DISARMED = auto()
    ARMED = auto()


class ArmingEvent(Enum):
    """What changes it."""

    ARM_ACCEPTED = auto()  # a command, after the checks or by force
    DISARM_ACCEPTED = auto()  # a command, on the ground or by force
    LANDED_TIMEOUT = auto()  # COM_DISARM_LAND after landing
    PREFLIGHT_TIMEOUT = auto()  # COM_DISARM_PRFLT without take-off
    FAILSAFE = auto()  # a failsafe whose parameter says so
    TERMINATED = auto()  # flight termination
    CRASHED = auto()  # the failure detector has seen a crash
    MOTOR_FAILED_ON_GROUND = auto()  # before the take-off, or after a landing without it


class IllegalArmingError(Exception):
    """The event means nothing in the present state."""


TRANSITIONS: Final[Mapping[tuple[Arming, ArmingEvent], Arming]] = {
    (Arming.DISARMED, ArmingEvent.ARM_ACCEPTED): Arming.ARMED,
    (Arming.ARMED, ArmingEvent.DISARM_ACCEPTED): Arming.DISARMED,
    (Arming.ARMED, ArmingEvent.LANDED_TIMEOUT): Arming.DISARMED,
    (Arming.ARMED, ArmingEvent.PREFLIGHT_TIMEOUT): Arming.DISARMED,
    (Arming.ARMED, ArmingEvent.FAILSAFE): Arming.DISARMED,
    (Arming.ARMED, ArmingEvent.TERMINATED): Arming.DISARMED,
    (Arming.ARMED, ArmingEvent.CRASHED): Arming.DISARMED,
    (Arming.ARMED, ArmingEvent.MOTOR_FAILED_ON_GROUND): Arming.DISARMED,
}


def after(state: Arming, event: ArmingEvent) -> Arming:
    """State after an event; raises IllegalArmingError for a pair not in the table."""
    try:
        return TRANSITIONS[state, event]
    except KeyError:
        raise IllegalArmingError(f"{event.name} while {state.name}") from None
