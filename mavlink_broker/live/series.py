"""Takes the steps of a live command one after the other: turns, pictures, short ways.

Places and headings count from where the vehicle was when it began; waits end by what the vehicle
tells, or by its own clock.
"""

import math
from collections.abc import Sequence
from typing import Final

from afarcloud.geodesy import distance_m, shifted
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import Accepted, Command, Refused, long_command
from mavlink_broker.microservices.command_sequence import CommandSequence, Ways
from mavlink_broker.planning.live_actions import (
    AS_IT_IS,
    Face,
    Order,
    Shift,
    Step,
    reposition,
    speed_order,
)
from mavlink_broker.planning.situation import Spot
from mavlink_broker.recovery.record import LiveNote, Pose
from mavlink_broker.vehicle.vehicle import Vehicle

FACING_WITHIN_DEG: Final = 5.0
THERE_WITHIN_M: Final = 1.5
STEP_WITHIN_S: Final = 40.0
"""What is not reached by then is taken as it is: a picture beside the mark is better than none."""
TURN_RATE_DEG_S: Final = 30.0


def heading_order(vehicle: Vehicle, here: Spot | None, heading_deg: float) -> Command | None:
    """Turn the nose where the vehicle is; None while its home is not known."""
    if vehicle.family.yaw_by_condition:
        way_round = (heading_deg % 360.0, TURN_RATE_DEG_S, 0.0, 0.0)
        return long_command(mavlink.MAV_CMD_CONDITION_YAW, *way_round)
    return way_order(vehicle, here, heading_deg)


def way_order(
    vehicle: Vehicle, spot: Spot | None, heading_deg: float, *, speed_m_s: float = AS_IT_IS
) -> Command | None:
    """Go to a place with a heading; None while home, where altitudes begin, is not known."""
    home = vehicle.snapshot.home
    if home is None or spot is None:
        return None
    yaw_rad = math.remainder(math.radians(heading_deg), 2.0 * math.pi)
    return reposition(spot, home, yaw_rad, speed_m_s=speed_m_s)


def missing_camera(vehicle: Vehicle, refusal: Refused) -> str | None:
    """Say that a refused order to the camera was for one that is not there, or lacks the function.

    A vehicle that has no camera flies its way all the same, as it does where pictures are items;
    None for a camera that is there and refuses.
    """
    if not vehicle.cameras:
        return "left out: no camera is heard on the vehicle"
    if refusal.result == mavlink.MAV_RESULT_UNSUPPORTED:
        return f"left out: {refusal.reason}"
    return None


class SeriesRunner:
    """One series on its way."""

    def __init__(
        self, steps: Sequence[Step], vehicle: Vehicle, *, speed_m_s: float = AS_IT_IS
    ) -> None:
        """Take the steps, and how fast it flies between places."""
        self._steps = list(steps)
        self._speed_m_s = speed_m_s
        self.steps = 0  # That have been taken
        self._vehicle = vehicle
        self._first: Spot | None = None
        self._first_heading_deg = 0.0
        self._sequence: CommandSequence | None = None
        self._accepted_at: float | None = None
        self._resting_since: float | None = None
        self.reason: str | None = None  # Why it cannot go on
        self.note: str | None = None  # What it is not, of what it was meant to be

    def resume(self, note: LiveNote) -> None:
        """Go on behind the steps that an earlier run of the broker has taken."""
        if note.start is None:
            return
        *place, self._first_heading_deg = note.start
        self._first = Spot(*place)
        del self._steps[: note.steps]
        self.steps = note.steps

    @property
    def start(self) -> Pose | None:
        """Where it began, once that is known."""
        return None if self._first is None else Pose(*self._first, self._first_heading_deg)

    @property
    def is_over(self) -> bool:
        """Whether all steps have been taken."""
        return not self._steps

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle or its payload."""
        if self._sequence is None:
            return []
        return self._sequence.receive(message, now)

    def tick(self, now: float) -> list[Message]:
        """Let time pass: go on with the step, or begin the next one."""
        if self.is_over or self.reason is not None:
            return []
        if self._first is None and not self._look_round():
            return []
        if self._sequence is None:
            return self._begin(now)
        messages = self._sequence.tick(now)
        outcome = self._sequence.outcome
        if isinstance(outcome, Refused):
            self._refused(outcome)
        elif isinstance(outcome, Accepted) and self._is_taken(now):
            self._steps.pop(0)
            self.steps += 1
            self._sequence = self._accepted_at = self._resting_since = None
        return messages

    def _refused(self, refusal: Refused) -> None:
        """End, or go on without pictures where nobody takes any."""
        missing = missing_camera(self._vehicle, refusal)
        if missing is None or not isinstance(self._steps[0], Order):
            self.reason = refusal.reason
            return
        self.note = f"pictures {missing}"
        self._steps = [step for step in self._steps if not isinstance(step, Order)]
        self._sequence = self._accepted_at = self._resting_since = None

    def _look_round(self) -> bool:
        """Note where it begins, once the vehicle has told."""
        place, attitude = self._vehicle.snapshot.position, self._vehicle.snapshot.attitude
        if place is None or attitude is None:
            return False
        self._first = Spot(place.latitude_deg, place.longitude_deg, place.altitude_m)
        self._first_heading_deg = attitude.yaw_deg
        return True

    def _begin(self, now: float) -> list[Message]:
        ways = self._ways(self._steps[0])
        if not ways:
            self.reason = "the vehicle's home is not known"
            return []
        vehicle = self._vehicle
        self._sequence = CommandSequence(ways, vehicle.route, vehicle.round_trip)
        return self._sequence.start(now)

    def _ways(self, step: Step) -> Ways:
        match step:
            case Order(ways):
                return ways
            case Face(turn_deg):
                heading_deg = self._first_heading_deg + turn_deg
                order = heading_order(self._vehicle, self._first, heading_deg)
                return () if order is None else ((order,),)
            case Shift():
                speed_m_s, heading_deg = self._speed_m_s, self._first_heading_deg
                spot, vehicle = self._spot(step), self._vehicle
                order = way_order(vehicle, spot, heading_deg, speed_m_s=speed_m_s)
                if order is None:
                    return ()
                sets_speed = vehicle.family.speed_by_order and speed_m_s > 0.0
                return ((order, speed_order(speed_m_s)) if sets_speed else (order,),)

    def _spot(self, step: Shift) -> Spot | None:
        if self._first is None:
            return None
        latitude, longitude, altitude_m = self._first
        place = shifted(latitude, longitude, self._first_heading_deg, step.forward_m)
        return Spot(*place, altitude_m + step.up_m)

    def _is_taken(self, now: float) -> bool:
        """Whether the step is done: what it was for has come about, and it has rested."""
        time_s = self._time_s(now)
        if self._accepted_at is None:
            self._accepted_at = time_s
        late = time_s - self._accepted_at >= STEP_WITHIN_S
        match self._steps[0]:
            case Order():
                return True
            case Face(turn_deg, rest_s):
                return self._has_rested(self._faces(turn_deg) or late, rest_s, time_s)
            case Shift() as step:
                return late or self._is_at(step)

    def _has_rested(self, there: bool, rest_s: float, time_s: float) -> bool:  # noqa: FBT001  # a fact
        if not there:
            self._resting_since = None
            return False
        if self._resting_since is None:
            self._resting_since = time_s
        return time_s - self._resting_since >= rest_s

    def _faces(self, turn_deg: float) -> bool:
        attitude = self._vehicle.snapshot.attitude
        if attitude is None:
            return False
        off_deg = math.remainder(attitude.yaw_deg - self._first_heading_deg - turn_deg, 360.0)
        return abs(off_deg) <= FACING_WITHIN_DEG

    def _is_at(self, step: Shift) -> bool:
        spot, place = self._spot(step), self._vehicle.snapshot.position
        if spot is None or place is None:
            return False
        high = abs(place.altitude_m - spot.relative_altitude_m)
        return max(distance_m(*place[:2], *spot[:2]), high) <= THERE_WITHIN_M

    def _time_s(self, now: float) -> float:
        told = self._vehicle.snapshot.time_s
        return now if told is None else told
