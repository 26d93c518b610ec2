"""Records the progress of one live command, so that a restarted broker continues it.

The progress is recorded before the command is sent, so that it is not sent twice; when the vehicle
has accepted it; and after every step. If the broker was killed between the first and the second,
messages of the vehicle and its camera show whether the command was received.
"""

from dataclasses import replace
from typing import Final, Protocol

from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.planning.live_actions import LiveAction, Tracked
from mavlink_broker.recovery.record import LiveCommandProgress, Pose
from mavlink_broker.vehicle.vehicle import Vehicle

LISTEN_S: Final = 6.0
"""For signs of a command; meanwhile a camera is asked for its newest pictures."""
_RECEIVED: Final = frozenset({mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS})


class Steps(Protocol):
    """A command that consists of steps."""

    @property
    def start(self) -> Pose | None:
        """The pose at its beginning, once it is known."""

    @property
    def steps(self) -> int:
        """The number of completed steps."""


class LiveCommandRecord:
    """The record of one live command; without a name it is never stored nor waited for."""

    def __init__(self, name: str | None, action: LiveAction, vehicle: Vehicle) -> None:
        """Read the record of an earlier run, if there is one."""
        self._name = name
        self._action = action
        self._vehicle = vehicle
        stored = vehicle.recovery.live
        is_known = stored is not None and name is not None and stored.name == name
        self.earlier = stored if is_known else None

    @property
    def was_accepted(self) -> bool:
        """Whether the vehicle has accepted it in an earlier run."""
        return self.earlier is not None and self.earlier.is_accepted

    @property
    def may_have_been_sent(self) -> bool:
        """Whether it may have been sent, and the vehicle's mode would not show it."""
        is_shown = self._action.moves and not isinstance(self._action.end, Tracked)
        return self.earlier is not None and not self.earlier.is_accepted and not is_shown

    def is_sign(self, message: Message) -> bool:
        """Whether a message shows that the command of an earlier run was received."""
        match message.get_type():
            case "COMMAND_ACK":
                return message.command == self._action.command and message.result in _RECEIVED
            case "CAMERA_IMAGE_CAPTURED":
                began_s = None if self.earlier is None else self.earlier.began_s
                taken_s = self._vehicle.snapshot.since_boot_s(message.time_boot_ms)
                return began_s is not None and taken_s > began_s
            case "CAMERA_TRACKING_IMAGE_STATUS":
                active: int = mavlink.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE
                return bool(message.tracking_status == active)
        return False

    def is_answer(self, message: Message) -> bool:
        """Whether it is the final acknowledgement of the command of an earlier run."""
        if message.get_type() != "COMMAND_ACK" or message.command != self._action.command:
            return False
        return bool(message.result != mavlink.MAV_RESULT_IN_PROGRESS)

    def may_send(self) -> bool:
        """Record that the command is about to be sent; whether that is on the disk."""
        if self._name is None:
            return True
        live = self._vehicle.recovery.live
        if live is None or live.name != self._name:
            began_s = self._vehicle.snapshot.time_s
            self._vehicle.recovery.note_live(LiveCommandProgress(name=self._name, began_s=began_s))
        return self._vehicle.recovery.is_stored

    def accept(self) -> None:
        """Record, once, that the vehicle has accepted it, and when."""
        live, now_s = self._vehicle.recovery.live, self._vehicle.snapshot.time_s
        if self._name is None:
            return
        if live is None or live.name != self._name:
            live = LiveCommandProgress(name=self._name, began_s=now_s)
        if not live.is_accepted:
            self._vehicle.recovery.note_live(replace(live, is_accepted=True, accepted_s=now_s))

    def store_progress(self, steps: Steps) -> None:
        """Record its progress."""
        live = self._vehicle.recovery.live
        if self._name is None or live is None or live.name != self._name or steps.start is None:
            return
        if (steps.start, steps.steps) != (live.start, live.steps):
            self._vehicle.recovery.note_live(replace(live, start=steps.start, steps=steps.steps))

    @property
    def elapsed_s(self) -> float:
        """Its duration by the vehicle's clock, if an earlier run began it."""
        time_s, earlier = self._vehicle.snapshot.time_s, self.earlier
        if time_s is None or earlier is None:
            return 0.0
        since_s = earlier.began_s if earlier.accepted_s is None else earlier.accepted_s
        return 0.0 if since_s is None else max(0.0, time_s - since_s)
