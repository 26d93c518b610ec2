"""A circle that the vehicle flies by itself, seen to its end.

A vehicle that counts its turns ends by itself, and holds. Of one that goes round and round the
positions tell how far it has gone.
"""

from typing import Final

from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.autopilots.orbit_support import Orbiting
from mavlink_broker.live.turn_angle import Turning
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.planning.live_actions import Turned
from mavlink_broker.recovery.record import LiveNote, Pose
from mavlink_broker.vehicle.vehicle import Vehicle

GAP_S: Final = 2.5
"""Without positions for so long, by its own time, a vehicle may have gone farther than is seen."""
FLOWN_FROM: Final = 0.7
"""Share of a turn from which on a vehicle that holds is believed to have counted it itself."""


class TurnRunner:
    """One turn; `resumed` if the vehicle had begun it before this broker looked."""

    steps = 0  # It is one
    reason: str | None = None  # It cannot fail
    note: str | None = None

    def __init__(self, end: Turned, vehicle: Vehicle, *, resumed: bool) -> None:
        self._vehicle = vehicle
        self._turning = Turning(end)
        self.start: Pose | None = None  # Where it came onto the circle
        self._was_guided = resumed
        self._was_circling = False  # Round and round, until it is told otherwise
        self._is_counted = not resumed  # Its positions show all of the turn
        self._placed_s: float | None = None

    def resume(self, note: LiveNote) -> None:
        """Count on from where an earlier run of the broker began."""
        time_s, self.start = self._vehicle.snapshot.time_s, note.start
        if time_s is not None and note.going_s is not None:
            self._turning.resume(note.start, max(0.0, time_s - note.going_s))

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a position."""
        del now
        place = self._vehicle.snapshot.position
        if message.get_type() == "GLOBAL_POSITION_INT" and place is not None:
            self._watch_gaps(self._vehicle.snapshot.time_s)
            self._turning.take(place.latitude_deg, place.longitude_deg)
            if self.start is None and self._turning.is_on_circle:
                self.start = Pose(*place[:3])
        return []

    def _watch_gaps(self, time_s: float | None) -> None:
        """Count nothing that was flown unseen."""
        before, self._placed_s = self._placed_s, time_s
        if time_s is None or (before is not None and time_s - before > GAP_S):
            self._is_counted = False

    def tick(self, now: float) -> list[Message]:
        """Let time pass."""
        del now
        is_guided = self._vehicle.mode_role is ModeRole.GUIDED
        self._was_guided |= is_guided
        self._was_circling |= is_guided and self._vehicle.family.orbiting is Orbiting.ENDLESS
        return []

    @property
    def is_over(self) -> bool:
        """Whether it has gone round, or has ended by itself."""
        return self._turning.is_complete or self.has_released

    @property
    def has_released(self) -> bool:
        """Whether a vehicle that counts its turns has ended by itself.

        One that does not may have been told to by an earlier run of the broker.
        """
        is_over = self._was_guided and not self._was_circling and not self._is_cut_short
        return is_over and self._vehicle.mode_role is ModeRole.HOLD

    @property
    def has_left(self) -> bool:
        """Whether a vehicle holds before its turn is over: somebody has paused it."""
        has_begun = self._was_circling or (self._was_guided and self._is_cut_short)
        return has_begun and self._vehicle.mode_role is ModeRole.HOLD

    @property
    def _is_cut_short(self) -> bool:
        """Whether its positions prove that it has not gone round."""
        return self._is_counted and self._turning.share < FLOWN_FROM
