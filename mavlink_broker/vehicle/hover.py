"""Whether a vehicle waits in the air where a mission of this broker has left it.

The place is noted, so that a restarted broker knows it again: a vehicle that is armed at that
place, and that no other system flies, has not been anywhere since.
"""

from typing import Final

from afarcloud.geodesy import distance_m
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.recovery.record import Pose
from mavlink_broker.vehicle.control_authority import (
    AIRBORNE_MODES,
    Authority,
    Claim,
    ObservedMode,
    authority_of,
)
from mavlink_broker.vehicle.telemetry import Position, Snapshot

WITHIN_M: Final = 30.0
"""Horizontally, with wind and another satellite fix."""
AS_HIGH_WITHIN_M: Final = 15.0
_OURS: Final = Claim(AIRBORNE_MODES, is_exclusive=True)


class Hover:
    """The hover of one vehicle."""

    def __init__(self) -> None:
        self._is_held = False
        self._place: Pose | None = None

    @property
    def is_held(self) -> bool:
        """Whether the vehicle hovers there, and no other system has taken it."""
        return self._is_held

    @property
    def place(self) -> Pose | None:
        """Where a mission has left it; of an earlier run, until the vehicle was found there."""
        return self._place

    def begin(self, position: Position | None) -> None:
        """Note that a mission has left the vehicle in the air."""
        self._is_held = True
        self._place = position and Pose(
            position.latitude_deg, position.longitude_deg, position.altitude_m
        )

    def end(self) -> None:
        """Note that the vehicle hovers no more, or for another system."""
        self._is_held, self._place = False, None

    def recall(self, place: Pose | None) -> None:
        """Take the place that an earlier run of the broker has noted."""
        self._place = place

    def update(self, snapshot: Snapshot, mode: ObservedMode, *, is_identified: bool) -> None:
        """End with a landing or a takeover; find the vehicle at the place of an earlier run."""
        is_ours = authority_of(mode, _OURS) is Authority.BROKER
        if snapshot.armed is False or (self._is_held and not is_ours):
            self.end()
        elif self._place is not None and not self._is_held and snapshot.armed is not None:
            if snapshot.position is None or not is_identified:
                return
            on_ground = snapshot.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
            if is_ours and not on_ground and _is_at(self._place, snapshot.position):
                self._is_held = True
            else:
                self.end()


def _is_at(place: Pose, position: Position) -> bool:
    is_near = distance_m(*position[:2], *place[:2]) <= WITHIN_M
    return is_near and abs(position.altitude_m - place.altitude_m) <= AS_HIGH_WITHIN_M
