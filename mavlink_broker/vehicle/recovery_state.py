"""What a restarted broker has to know of one vehicle, and whether it is on the disk.

Whoever learns something of it calls a method here. The journal (`mavlink_broker.recovery`) stores
the whole as one record.

`Hover`: where a vehicle waits in the air because a mission of this broker has left it there. The
place is noted, so that a restarted broker knows it again: a vehicle that is armed at that place,
and that no other system flies, has not been anywhere since.

"""

from typing import Final

from afarcloud.geodesy import distance_m
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.microservices.config_overrides import ParameterOverrider, VehicleOverrides
from mavlink_broker.recovery.record import (
    LiveCommandProgress,
    PendingAbort,
    PendingReturn,
    Pose,
    RecordTracker,
    RecoveryRecord,
    merge_records,
)
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
        """Restore the place that an earlier run of the broker has noted."""
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


class RecoveryState:
    """Of one vehicle."""

    def __init__(self, tracker: RecordTracker | None = None) -> None:
        """Begin with nothing; without a tracker nothing is stored, and nothing waited for."""
        self.tracker = tracker or RecordTracker()
        self.overrides = VehicleOverrides()  # By the geofence of a plan
        self.parameters = ParameterOverrider()
        self.hover = Hover()
        self._return: PendingReturn | None = None
        self._abort: PendingAbort | None = None
        self._held_abort: PendingAbort | None = None
        self._live: LiveCommandProgress | None = None
        self._segment: str | None = None
        self._paused: str | None = None

    @property
    def live(self) -> LiveCommandProgress | None:
        """The live command that was ordered last."""
        return self._live

    @property
    def segment(self) -> str | None:
        """Name of the first command of the items that the vehicle was ordered to fly last."""
        return self._segment

    def note_live(self, progress: LiveCommandProgress) -> None:
        """Note how far a live command is."""
        self._live = progress

    def note_segment(self, first_command: str) -> None:
        """Note that the vehicle is about to be ordered to fly items."""
        self._segment = first_command

    @property
    def paused(self) -> str | None:
        """Name of the work that an event has paused."""
        return self._paused

    def note_pause(self, mission: str) -> None:
        """Note that an event has paused a mission."""
        self._paused = mission

    def clear_pause(self) -> None:
        """Forget the pause: the mission flies, or has ended."""
        self._paused = None

    def clear_live(self) -> None:
        """Forget the live command: the vehicle has left it, and it begins anew."""
        self._live = None

    def clear_commands(self) -> None:
        """Forget live command and segment: none is flown, or those of another mission."""
        self._live = self._segment = None

    def note_abort(self, abort: PendingAbort) -> None:
        """Note an abort that was accepted, until the vehicle has obeyed."""
        self._abort = abort

    def clear_abort(self) -> None:
        """Forget the abort."""
        self._abort = None

    def hold_abort(self, abort: PendingAbort) -> None:
        """Note an abort that is done, but for missions that may be handed out again."""
        self._held_abort = abort

    def release_abort(self) -> None:
        """Forget that abort: none of its missions may be handed out again."""
        self._held_abort = None

    def note_return(self, pending: PendingReturn) -> None:
        """Note that an alarm has sent the vehicle home, until it has obeyed."""
        self._return = pending

    def clear_return(self) -> None:
        """Forget the return."""
        self._return = None

    @property
    def record(self) -> RecoveryRecord:
        """All of it, as the journal stores it."""
        return RecoveryRecord(
            plans=dict(self.overrides.plans),
            values=dict(self.overrides.values),
            borrowed=self.parameters.overridden,
            hover=self.hover.place,
            pending_return=self._return,
            abort=self._abort or self._held_abort,
            live=self._live,
            started=self._segment,
            paused=self._paused,
        )

    @property
    def is_stored(self) -> bool:
        """Whether a broker that is killed now knows all of it again."""
        return self.tracker.is_stored(self.record)

    def recall(self, record: RecoveryRecord) -> None:
        """Restore what an earlier run of the broker has noted."""
        both = merge_records(record, self.record)
        self.overrides.plans, self.overrides.values = dict(both.plans), dict(both.values)
        self.parameters.load(both.borrowed)
        self.hover.recall(both.hover)
        self._return, self._live = both.pending_return, both.live
        self._abort, self._segment = both.abort, both.started
        self._paused = both.paused

    def forget(self) -> None:
        """Begin with nothing again: another vehicle has taken the place of this one."""
        self.overrides, self.parameters = VehicleOverrides(), ParameterOverrider()
        self.hover.end()
        self._return = self._abort = self._held_abort = self._paused = None
        self.clear_commands()
