"""What a restarted broker has to know of one vehicle, and whether it is on the disk.

Whoever learns something of it calls a method here. The journal (`mavlink_broker.recovery`) stores
the whole as one record.
"""

from mavlink_broker.microservices.config_overrides import ParameterOverrider, VehicleOverrides
from mavlink_broker.recovery.record import (
    LiveCommandProgress,
    PendingAbort,
    PendingReturn,
    RecoveryRecord,
    merge_records,
)
from mavlink_broker.recovery.record_tracker import RecordTracker
from mavlink_broker.vehicle.hover import Hover


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
        """Take what an earlier run of the broker has noted."""
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
