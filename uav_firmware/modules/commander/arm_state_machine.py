"""Arming states: the table of transitions, and disarming without a command.

A pair that is not in the table changes nothing and raises IllegalArmingError.

DISARMED --ARM_ACCEPTED--> ARMED
ARMED --DISARM_ACCEPTED | LANDED_TIMEOUT | PREFLIGHT_TIMEOUT | FAILSAFE | TERMINATED--> DISARMED
ARMED --CRASHED | MOTOR_FAILED_ON_GROUND--> DISARMED
"""

from collections.abc import Mapping
from enum import Enum, auto
from typing import Final

from uav_firmware.modules.commander.params import CommanderParams
from uav_firmware.msg.mission import MissionState
from uav_firmware.msg.status import Severity


class Arming(Enum):
    """Whether the motors may turn."""

    DISARMED = auto()
    ARMED = auto()


class ArmingEvent(Enum):
    """An event that changes it."""

    ARM_ACCEPTED = auto()  # a command, after the checks or by force
    DISARM_ACCEPTED = auto()  # a command, on the ground or by force
    LANDED_TIMEOUT = auto()  # COM_DISARM_LAND after landing
    PREFLIGHT_TIMEOUT = auto()  # COM_DISARM_PRFLT without take-off
    FAILSAFE = auto()  # a failsafe by its parameter
    TERMINATED = auto()  # flight termination
    CRASHED = auto()  # the failure detector has detected a crash
    MOTOR_FAILED_ON_GROUND = auto()  # before the take-off, or after a landing without it


class IllegalArmingError(Exception):
    """The event has no transition in the present state."""


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


LIFTING_S: Final = 30.0
"""A vehicle that is still landed after so long with its throttle up cannot take off."""


class DisarmTimer:
    """Disarms after a landing, or when no take-off follows the arming."""

    def __init__(self) -> None:
        self._flown = False
        self._grounded_since_us = 0  # At rest, as far as its throttle lets it be
        self._landed_since_us = 0  # Whatever its throttle
        self._mission_since_us = 0  # Began on the ground, or has flown

    def start(self, now_us: int) -> None:
        """Begin at the arming."""
        self._flown = False
        self._grounded_since_us = self._landed_since_us = self._mission_since_us = now_us

    def due(
        self,
        now_us: int,
        *,
        landed: bool,
        resting: bool,
        mission_state: int,
        params: CommanderParams,
    ) -> ArmingEvent | None:
        """Event that disarms now, if any.

        Time counts while the vehicle rests: one that takes off slowly, at the first centimetres,
        is landed, but not resting. Where that leads to no take-off, it is disarmed later.

        A mission that continues after a landing, or waits before its take-off, stays armed; one
        that does not take off, for COM_DISARM_MIS.
        """
        if not landed:
            self._flown = True
        in_mission = mission_state == MissionState.ACTIVE
        if self._flown or not in_mission:
            self._mission_since_us = now_us
        waited_s = (now_us - self._mission_since_us) * 1e-6
        if waited_s > 0.0 and 0.0 <= params.disarm_mission_s <= waited_s:
            return ArmingEvent.PREFLIGHT_TIMEOUT
        if not landed or in_mission:
            self._grounded_since_us = self._landed_since_us = now_us
            return None
        grounded_s = (now_us - self._grounded_since_us) * 1e-6
        if not resting:
            self._grounded_since_us = now_us
            grounded_s = (now_us - self._landed_since_us) * 1e-6 - LIFTING_S
        if self._flown:
            over = 0.0 <= params.disarm_landed_s <= grounded_s
            return ArmingEvent.LANDED_TIMEOUT if over else None
        over = 0.0 <= params.disarm_preflight_s <= grounded_s
        return ArmingEvent.PREFLIGHT_TIMEOUT if over else None


DISARM_TEXTS: Final[Mapping[ArmingEvent, tuple[Severity, str]]] = {
    ArmingEvent.DISARM_ACCEPTED: (Severity.INFO, "Disarmed by command"),
    ArmingEvent.LANDED_TIMEOUT: (Severity.INFO, "Disarmed after landing"),
    ArmingEvent.PREFLIGHT_TIMEOUT: (Severity.INFO, "Disarmed: no take-off"),
    ArmingEvent.FAILSAFE: (Severity.EMERGENCY, "Disarmed by failsafe"),
    ArmingEvent.TERMINATED: (Severity.EMERGENCY, "Flight terminated"),
    ArmingEvent.CRASHED: (Severity.EMERGENCY, "Crash detected, motors stopped"),
    ArmingEvent.MOTOR_FAILED_ON_GROUND: (Severity.CRITICAL, "Disarmed: motor failure"),
}
