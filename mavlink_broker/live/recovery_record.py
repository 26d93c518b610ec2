"""What is noted of one live command, so that a broker that was killed goes on with it.

It is noted before the vehicle is told, so that nobody tells it twice; when the vehicle has agreed;
and with every step since. Where the broker died between the first and the second, what the
vehicle and its camera say tells whether the order was heard.
"""

from dataclasses import replace
from typing import Final, Protocol

from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.planning.live_actions import LiveAction, Tracked
from mavlink_broker.recovery.record import LiveNote, Pose
from mavlink_broker.vehicle.vehicle import Vehicle

LISTENS_S: Final = 6.0
"""For signs of an order: a camera is asked for its newest pictures meanwhile."""
_HEARD: Final = frozenset({mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS})


class Steps(Protocol):
    """Something that is done step by step."""

    @property
    def start(self) -> Pose | None:
        """Where it counts from, once it has looked round."""

    @property
    def steps(self) -> int:
        """How many have been taken."""


class LiveRecord:
    """One live command; without a name nothing is noted, and nothing waited for."""

    def __init__(self, name: str | None, action: LiveAction, vehicle: Vehicle) -> None:
        """Take up what an earlier run has noted of it, if anything."""
        self._name = name
        self._action = action
        self._vehicle = vehicle
        noted = vehicle.live
        is_known = noted is not None and name is not None and noted.name == name
        self.earlier = noted if is_known else None

    @property
    def was_agreed(self) -> bool:
        """Whether the vehicle has agreed to it in an earlier run."""
        return self.earlier is not None and self.earlier.is_agreed

    @property
    def is_doubtful(self) -> bool:
        """Whether it may have been told, which its mode would not show."""
        shows = self._action.moves and not isinstance(self._action.end, Tracked)
        return self.earlier is not None and not self.earlier.is_agreed and not shows

    def is_sign(self, message: Message) -> bool:
        """Whether a message shows that an earlier run's order was heard."""
        match message.get_type():
            case "COMMAND_ACK":
                return message.command == self._action.order and message.result in _HEARD
            case "CAMERA_IMAGE_CAPTURED":
                began_s = None if self.earlier is None else self.earlier.began_s
                taken_s = self._vehicle.snapshot.since_boot_s(message.time_boot_ms)
                return began_s is not None and taken_s > began_s
            case "CAMERA_TRACKING_IMAGE_STATUS":
                active: int = mavlink.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE
                return bool(message.tracking_status == active)
        return False

    def is_answer(self, message: Message) -> bool:
        """Whether the vehicle has done what it was told by an earlier run of the broker."""
        if message.get_type() != "COMMAND_ACK" or message.command != self._action.order:
            return False
        return bool(message.result != mavlink.MAV_RESULT_IN_PROGRESS)

    def may_order(self) -> bool:
        """Note that the vehicle is about to be told; whether that is on the disk."""
        if self._name is None:
            return True
        live = self._vehicle.live
        if live is None or live.name != self._name:
            began_s = self._vehicle.snapshot.time_s
            self._vehicle.live = LiveNote(name=self._name, began_s=began_s)
        return self._vehicle.is_noted

    def agree(self) -> None:
        """Note, once, that the vehicle has agreed, and when."""
        live, now_s = self._vehicle.live, self._vehicle.snapshot.time_s
        if self._name is None:
            return
        if live is None or live.name != self._name:
            live = LiveNote(name=self._name, began_s=now_s)
        if not live.is_agreed:
            self._vehicle.live = replace(live, is_agreed=True, going_s=now_s)

    def keep(self, done: Steps) -> None:
        """Note how far it is."""
        live = self._vehicle.live
        if self._name is None or live is None or live.name != self._name or done.start is None:
            return
        if (done.start, done.steps) != (live.start, live.steps):
            self._vehicle.live = replace(live, start=done.start, steps=done.steps)

    @property
    def elapsed_s(self) -> float:
        """How long it has been going on by the vehicle's clock, if an earlier run began it."""
        time_s, earlier = self._vehicle.snapshot.time_s, self.earlier
        if time_s is None or earlier is None:
            return 0.0
        since_s = earlier.began_s if earlier.going_s is None else earlier.going_s
        return 0.0 if since_s is None else max(0.0, time_s - since_s)
