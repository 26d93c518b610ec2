"""Executes the steps of a live command one after the other: turns, pictures, short moves.

Positions and headings are relative to the vehicle's pose at the beginning; a step ends when the
vehicle's messages show it, or after a time by the vehicle's clock.
"""

import math
from collections.abc import Sequence
from typing import Final

from afarcloud.geodesy import distance_m, shifted
from afarcloud.route import Spot
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import (
    Accepted,
    Command,
    CommandAlternatives,
    CommandSequence,
    Refused,
    long_command,
)
from mavlink_broker.planning.situation import (
    KEEP_SPEED,
    Move,
    Pose,
    SendCommand,
    Step,
    TurnInPlace,
    reposition,
    speed_command,
)
from mavlink_broker.vehicle.recovery_state import LiveCommandProgress
from mavlink_broker.vehicle.vehicle import Vehicle

FACING_WITHIN_DEG: Final = 5.0
POSE_WITHIN_M: Final = 1.5
STEP_TIMEOUT_S: Final = 40.0
"""After this time the step counts as done: a picture from a nearby pose is better than none."""
TURN_RATE_DEG_S: Final = 30.0


def heading_command(vehicle: Vehicle, here: Spot | None, heading_deg: float) -> Command | None:
    """Make the command to turn in place; None while the vehicle's home is not known."""
    if vehicle.family.yaw_by_condition:
        parameters = (heading_deg % 360.0, TURN_RATE_DEG_S, 0.0, 0.0)
        return long_command(mavlink.MAV_CMD_CONDITION_YAW, *parameters)
    return reposition_command(vehicle, here, heading_deg)


def reposition_command(
    vehicle: Vehicle, spot: Spot | None, heading_deg: float, *, speed_m_s: float = KEEP_SPEED
) -> Command | None:
    """Make the command to fly to a position with a heading; None while home is not known."""
    home = vehicle.snapshot.home
    if home is None or spot is None:
        return None
    yaw_rad = math.remainder(math.radians(heading_deg), math.tau)
    return reposition(spot, home, yaw_rad, speed_m_s=speed_m_s)


def camera_note(vehicle: Vehicle, refusal: Refused) -> str | None:
    """Give a note for a refused camera command if there is no camera or it lacks the function.

    A vehicle without a camera flies on, as it does where pictures are mission items; None for a
    camera that exists and refuses.
    """
    if not vehicle.cameras:
        return "left out: the vehicle has no camera"
    if refusal.result == mavlink.MAV_RESULT_UNSUPPORTED:
        return f"left out: {refusal.reason}"
    return None


class StepSeries:
    """One sequence of steps."""

    def __init__(
        self, steps: Sequence[Step], vehicle: Vehicle, *, speed_m_s: float = KEEP_SPEED
    ) -> None:
        """Fly these steps; `speed_m_s` applies between positions."""
        self._steps = list(steps)
        self._speed_m_s = speed_m_s
        self.steps = 0  # Completed
        self.start: Pose | None = None
        """The pose at its beginning, once it is known."""
        self._vehicle = vehicle
        self._sequence: CommandSequence | None = None
        self._accepted_at: float | None = None
        self._resting_since: float | None = None
        self.reason: str | None = None  # Why it has failed
        self.note: str | None = None  # What is left out

    def resume(self, note: LiveCommandProgress) -> None:
        """Continue after the steps that an earlier run of the broker has completed."""
        if note.start is not None:
            self.start, self.steps = note.start, note.steps
            del self._steps[: note.steps]

    @property
    def is_over(self) -> bool:
        """Whether all steps are done."""
        return not self._steps

    def receive(self, message: Message, now: float) -> list[Message]:
        """Process a message of the vehicle or its payload."""
        if self._sequence is None:
            return []
        return self._sequence.receive(message, now)

    def tick(self, now: float) -> list[Message]:
        """Continue the current step, or begin the next one."""
        if self.is_over or self.reason is not None:
            return []
        self.start = self.start or self._vehicle.pose
        if self.start is None:
            return []
        if self._sequence is None:
            return self._begin(self.start, now)
        messages = self._sequence.tick(now)
        outcome = self._sequence.outcome
        if isinstance(outcome, Refused):
            self._refused(outcome)
        elif isinstance(outcome, Accepted) and self._is_done(self.start, now):
            self._steps.pop(0)
            self.steps += 1
            self._sequence = self._accepted_at = self._resting_since = None
        return messages

    def _refused(self, refusal: Refused) -> None:
        """End, or continue without pictures if there is no camera."""
        missing = camera_note(self._vehicle, refusal)
        if missing is None or not isinstance(self._steps[0], SendCommand):
            self.reason = refusal.reason
            return
        self.note = f"pictures {missing}"
        self._steps = [step for step in self._steps if not isinstance(step, SendCommand)]
        self._sequence = self._accepted_at = self._resting_since = None

    def _begin(self, start: Pose, now: float) -> list[Message]:
        alternatives = self._alternatives(self._steps[0], start)
        if not alternatives:
            self.reason = "the vehicle's home is not known"
            return []
        self._sequence = self._vehicle.sequence(alternatives)
        return self._sequence.start(now)

    def _alternatives(self, step: Step, start: Pose) -> CommandAlternatives:
        match step:
            case SendCommand(alternatives):
                return alternatives
            case TurnInPlace(turn_deg):
                here, heading_deg = Spot(*start[:3]), start.heading_deg + turn_deg
                command = heading_command(self._vehicle, here, heading_deg)
                return () if command is None else ((command,),)
            case Move():
                speed_m_s, vehicle = self._speed_m_s, self._vehicle
                spot, heading_deg = _spot_of(step, start), start.heading_deg
                command = reposition_command(vehicle, spot, heading_deg, speed_m_s=speed_m_s)
                if command is None:
                    return ()
                sets_speed = vehicle.family.speed_by_command and speed_m_s > 0.0
                return ((command, speed_command(speed_m_s)) if sets_speed else (command,),)

    def _is_done(self, start: Pose, now: float) -> bool:
        """Whether the step is done: its pose is reached, and it has rested there."""
        time_s = self._vehicle.time_s(now)
        if self._accepted_at is None:
            self._accepted_at = time_s
        late = time_s - self._accepted_at >= STEP_TIMEOUT_S
        match self._steps[0]:
            case SendCommand():
                return True
            case TurnInPlace(turn_deg, rest_s):
                is_there = self._faces(start.heading_deg + turn_deg) or late
                return self._has_rested(rest_s, time_s, is_there=is_there)
            case Move() as step:
                return late or self._is_at(_spot_of(step, start))

    def _has_rested(self, rest_s: float, time_s: float, *, is_there: bool) -> bool:
        if not is_there:
            self._resting_since = None
            return False
        if self._resting_since is None:
            self._resting_since = time_s
        return time_s - self._resting_since >= rest_s

    def _faces(self, heading_deg: float) -> bool:
        attitude = self._vehicle.snapshot.attitude
        if attitude is None:
            return False
        off_deg = math.remainder(attitude.yaw_deg - heading_deg, 360.0)
        return abs(off_deg) <= FACING_WITHIN_DEG

    def _is_at(self, spot: Spot) -> bool:
        position = self._vehicle.snapshot.position
        if position is None:
            return False
        vertical_m = abs(position.altitude_m - spot.relative_altitude_m)
        return max(distance_m(*position[:2], *spot[:2]), vertical_m) <= POSE_WITHIN_M


def _spot_of(step: Move, start: Pose) -> Spot:
    place = shifted(start.latitude_deg, start.longitude_deg, start.heading_deg, step.forward_m)
    return Spot(*place, start.altitude_m + step.up_m)
