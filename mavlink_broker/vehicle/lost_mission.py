"""A flight that the broker has ordered, and whose mission the edge server does not know any more.

An edge server that has lost its database does not hand the mission out to a broker that is
restarted. The vehicle flies on, and nobody's report ends it. The journal still shows whose flight
it is: an earlier run has noted the items, or the live command, that it ordered and that the vehicle
has begun. So an event may still end it. It is over with a landing, with a takeover, with a restart
of the vehicle, and as soon as a mission is known again.
"""

from typing import Final

from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.vehicle.control_authority import (
    HOVERING,
    Authority,
    ObservedMode,
    authority_of,
)
from mavlink_broker.vehicle.telemetry import Snapshot

ABORT_ENDS_IT: Final = (
    "the vehicle flies a mission that the edge server does not know: "
    "an abort or a return home ends it"
)
_GUIDED: Final = frozenset({ModeRole.HOLD, ModeRole.GUIDED})
_HOLDING: Final = frozenset({ModeRole.HOLD, ModeRole.PAUSED})


class LostMission:
    """The flight of one vehicle for a mission that is not known."""

    def __init__(self) -> None:
        self.is_flown = False
        """Whether the vehicle flies it, and nobody else has the vehicle."""
        self.is_sought = False
        """Whether an earlier run has noted it, and its vehicle was not seen yet."""
        self._began_s: float | None = None  # By the vehicle's clock since boot
        self._is_live = False  # The vehicle was guided last
        self._mission_id = 0  # Of the items that it holds, since it was found; 0: not known

    def recall(self, began_s: float | None, *, is_live: bool) -> None:
        """Note that an earlier run has begun it, at a time of the vehicle's clock."""
        self.is_flown, self.is_sought = False, True
        self._began_s, self._is_live, self._mission_id = began_s, is_live, 0

    def end(self) -> None:
        """Note that it is over, or that its mission is known."""
        self.is_flown = self.is_sought = False

    @property
    def warning(self) -> str | None:
        """For an operator, while the vehicle flies it."""
        return ABORT_ENDS_IT if self.is_flown else None

    def own_mode(self, seen: ObservedMode) -> str | None:
        """Give the present mode while the vehicle flies it, for the broker has ordered it."""
        return seen.mode if self.is_flown else None

    def update(
        self,
        seen: ObservedMode,
        snapshot: Snapshot,
        *,
        paused_mode: str | None,
        is_paused: bool,
        was_taken: bool,
    ) -> None:
        """Find the flight, or end it.

        `is_paused` if an event has paused the mission, in `paused_mode` or in a hold; `was_taken`
        if an earlier run has noted that somebody else had the vehicle.
        """
        lacks_time = self._began_s is not None and snapshot.time_s is None
        if seen.armed is None or (self.is_sought and lacks_time):
            return  # Its clock shows whether it was restarted since
        claim = HOVERING._replace(mode=paused_mode if is_paused else None)
        is_ours = seen.armed and authority_of(seen, claim) is Authority.BROKER
        if self.is_sought:
            is_ours &= self._is_begun(seen, is_paused=is_paused) and not was_taken
        is_ours &= not self._was_restarted(snapshot) and not self._holds_another(snapshot)
        self.is_flown, self.is_sought = bool(is_ours), False

    def _is_begun(self, seen: ObservedMode, *, is_paused: bool) -> bool:
        """Whether the vehicle shows what was ordered last; any other hold may be somebody's."""
        if not seen.is_known or seen.role is ModeRole.MISSION:
            return True
        is_live = self._is_live and seen.role in _GUIDED
        return is_live or (is_paused and seen.role in _HOLDING)

    def _was_restarted(self, snapshot: Snapshot) -> bool:
        time_s, began_s = snapshot.time_s, self._began_s
        return time_s is not None and began_s is not None and time_s < began_s

    def _holds_another(self, snapshot: Snapshot) -> bool:
        """Whether another system has given it other items since it was found."""
        present = 0 if snapshot.mission is None else snapshot.mission.mission_id
        self._mission_id = self._mission_id or present
        return present not in {0, self._mission_id}
