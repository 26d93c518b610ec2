"""Monitors an orbit that the vehicle flies by itself.

A vehicle that counts its turns ends the orbit by itself, and holds. For one that orbits without end
the positions show the angle that it has flown.
"""

from typing import Final

from mavlink_broker.autopilots.families import OrbitMethod
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.live.turn_angle import TurnAngle
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.planning.live_actions import Turned
from mavlink_broker.recovery.record import LiveCommandProgress, Pose
from mavlink_broker.vehicle.vehicle import Vehicle

GAP_S: Final = 2.5
"""After such a gap between positions, by its own clock, the angle is not known."""
COUNTED_FROM: Final = 0.7
"""A vehicle that holds after this share of a turn has ended the turn by itself."""


class OrbitMonitor:
    """One turn; `resumed` if the vehicle had begun it before this broker started."""

    steps = 0  # It is one
    reason: str | None = None  # It cannot fail
    note: str | None = None

    def __init__(self, end: Turned, vehicle: Vehicle, *, resumed: bool) -> None:
        self._vehicle = vehicle
        self._turning = TurnAngle(end)
        self.start: Pose | None = None  # Where it reached the circle
        self._was_guided = resumed
        self._was_circling = False  # Without end, until a command ends it
        self._is_counted = not resumed  # There is no gap between its positions
        self._position_s: float | None = None

    def resume(self, note: LiveCommandProgress) -> None:
        """Continue the turn that an earlier run of the broker began."""
        time_s, self.start = self._vehicle.snapshot.time_s, note.start
        if time_s is not None and note.accepted_s is not None:
            self._turning.resume(note.start, max(0.0, time_s - note.accepted_s))

    def receive(self, message: Message, now: float) -> list[Message]:
        """Process a position."""
        del now
        position = self._vehicle.snapshot.position
        if message.get_type() == "GLOBAL_POSITION_INT" and position is not None:
            self._check_gap(self._vehicle.snapshot.time_s)
            self._turning.take(position.latitude_deg, position.longitude_deg)
            if self.start is None and self._turning.is_on_circle:
                self.start = Pose(*position[:3])
        return []

    def _check_gap(self, time_s: float | None) -> None:
        """Mark the turn as not counted after a gap between positions."""
        before, self._position_s = self._position_s, time_s
        if time_s is None or (before is not None and time_s - before > GAP_S):
            self._is_counted = False

    def tick(self, now: float) -> list[Message]:
        """Do what is due at a time."""
        del now
        is_guided = self._vehicle.mode_role is ModeRole.GUIDED
        self._was_guided |= is_guided
        self._was_circling |= is_guided and self._vehicle.family.orbiting is OrbitMethod.ENDLESS
        return []

    @property
    def is_over(self) -> bool:
        """Whether the turn is complete, or the vehicle has ended it by itself."""
        return self._turning.is_complete or self.has_released

    @property
    def has_released(self) -> bool:
        """Whether a vehicle that counts its turns has ended the turn by itself.

        For one that does not an earlier run of the broker may have ended it.
        """
        is_over = self._was_guided and not self._was_circling and not self._is_cut_short
        return is_over and self._vehicle.mode_role is ModeRole.HOLD

    @property
    def has_left(self) -> bool:
        """Whether the vehicle holds before its turn is over: it was paused."""
        has_begun = self._was_circling or (self._was_guided and self._is_cut_short)
        return has_begun and self._vehicle.mode_role is ModeRole.HOLD

    @property
    def _is_cut_short(self) -> bool:
        """Whether its positions prove that the turn is not complete."""
        return self._is_counted and self._turning.share < COUNTED_FROM
