"""From standing motors to free flight: idle first, then a thrust limit that rises.

    DISARMED --ARM--> SPOOL_UP --SPOOLED--> READY --CLIMB--> RAMP_UP --RAMPED--> FLIGHT
        SPOOL_UP, READY --LIFTED--> FLIGHT      (armed or restarted in the air)
        FLIGHT --LANDED--> READY
        any --DISARM--> DISARMED

The ramp keeps the integrators from throwing the vehicle off the ground, and the landing gear
from dragging while the thrust is nearly enough.
"""

from collections.abc import Mapping
from enum import IntEnum
from typing import Final


class Takeoff(IntEnum):
    """Where a take-off stands."""

    DISARMED = 0
    SPOOL_UP = 1  # motors idle
    READY = 2  # on the ground, motors idle
    RAMP_UP = 3  # thrust limit rises
    FLIGHT = 4  # no limit


class TakeoffEvent(IntEnum):
    """What moves a take-off on."""

    ARM = 0
    DISARM = 1
    SPOOLED = 2  # spool-up time has passed
    CLIMB = 3  # a setpoint wants to go up
    RAMPED = 4  # ramp time has passed
    LIFTED = 5  # the land detector sees the vehicle in the air
    LANDED = 6  # the land detector sees it on the ground


TRANSITIONS: Final[Mapping[tuple[Takeoff, TakeoffEvent], Takeoff]] = {
    (Takeoff.DISARMED, TakeoffEvent.ARM): Takeoff.SPOOL_UP,
    (Takeoff.SPOOL_UP, TakeoffEvent.SPOOLED): Takeoff.READY,
    (Takeoff.SPOOL_UP, TakeoffEvent.LIFTED): Takeoff.FLIGHT,
    (Takeoff.SPOOL_UP, TakeoffEvent.DISARM): Takeoff.DISARMED,
    (Takeoff.READY, TakeoffEvent.CLIMB): Takeoff.RAMP_UP,
    (Takeoff.READY, TakeoffEvent.LIFTED): Takeoff.FLIGHT,
    (Takeoff.READY, TakeoffEvent.DISARM): Takeoff.DISARMED,
    (Takeoff.RAMP_UP, TakeoffEvent.RAMPED): Takeoff.FLIGHT,
    (Takeoff.RAMP_UP, TakeoffEvent.DISARM): Takeoff.DISARMED,
    (Takeoff.FLIGHT, TakeoffEvent.LANDED): Takeoff.READY,
    (Takeoff.FLIGHT, TakeoffEvent.DISARM): Takeoff.DISARMED,
}


class TakeoffRamp:
    """The present state, and since when [s]."""

    __slots__ = ("_entered_s", "_was_airborne", "state")

    def __init__(self) -> None:
        self.state = Takeoff.DISARMED
        self._entered_s = 0.0
        self._was_airborne = False  # without it, a slow lift-off would count as a landing

    def update(
        self,
        *,
        now_s: float,
        armed: bool,
        landed: bool,
        wants_climb: bool,
        spool_up_time_s: float,
        ramp_time_s: float,
    ) -> Takeoff:
        """Apply the events that hold now, at most one, the most urgent first."""
        if self.state is Takeoff.FLIGHT and armed and not landed:  # The usual case: none of them
            self._was_airborne = True
            return self.state
        elapsed = now_s - self._entered_s
        ramping = self.state is Takeoff.RAMP_UP
        events = (
            (not armed, TakeoffEvent.DISARM),
            (armed, TakeoffEvent.ARM),
            (not landed and not ramping, TakeoffEvent.LIFTED),
            (elapsed >= spool_up_time_s, TakeoffEvent.SPOOLED),
            (wants_climb, TakeoffEvent.CLIMB),
            (elapsed >= ramp_time_s, TakeoffEvent.RAMPED),
            (landed and self._was_airborne, TakeoffEvent.LANDED),
        )
        self._was_airborne = not landed
        for holds, event in events:
            target = TRANSITIONS.get((self.state, event)) if holds else None
            if target is not None:
                self.state = target
                self._entered_s = now_s
                break
        return self.state

    def thrust_limit(self, *, now_s: float, ramp_time_s: float, start: float, full: float) -> float:
        """Largest collective thrust now [-]: 0 on the ground, `full` in flight."""
        if self.state is Takeoff.FLIGHT:
            return full
        if self.state is not Takeoff.RAMP_UP:
            return 0.0
        share = min((now_s - self._entered_s) / ramp_time_s, 1.0)
        return start + share * (full - start)
