"""Whether a camera has done what it was ordered to, where its last answer was lost.

A camera that works on an order answers IN_PROGRESS and takes pictures. When it falls silent, its
final answer may be lost, and an order that is given again would be carried out again: a vehicle
keeps its answers for some seconds only. So the camera is asked for its state, and what it has
captured decides: idle with new pictures, it has done the order; idle without, it has not, and may
be ordered again. Of several cameras all that are asked must be idle: the order may be for any. One
that does not answer is waited for as long as behind a series: then the order is done if only
others have shown signs of work, and are idle; else nobody knows, and it fails.
"""

from enum import Enum, auto
from typing import Final

from mavlink_broker.mavlink.dialect import Message, mavlink, source_of
from mavlink_broker.microservices.command import long_command
from mavlink_broker.vehicle.vehicle import Vehicle

SILENT_AFTER_S: Final = 3.0
"""Several times as long as a camera at work is silent."""
ASK_EVERY_S: Final = 1.0
PATIENCE_S: Final = 20.0
"""With a camera that does not answer; what `series_monitor` adds to the time of a series."""
_STATUS: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS
_IDLE: Final = 0


class Verdict(Enum):
    """What is known of the order."""

    UNHEARD = auto()  # No sign of it: it may be given again
    AT_WORK = auto()  # It was heard; it is not known yet how it ended
    DONE = auto()
    NOTHING_DONE = auto()  # It was heard, and nothing has come of it: it may be given again


class CaptureJudge:
    """One order to a camera that takes time."""

    def __init__(self, order: int, vehicle: Vehicle) -> None:
        """Watch for the signs of a MAV_CMD."""
        self._order = order
        self._vehicle = vehicle
        self._began_s = vehicle.snapshot.time_s
        self._signs_at: float | None = None  # The newest sign of work
        self._asked_at: float | None = None
        self._asked_since: float | None = None  # Without a sign, while the vehicle sends
        self._idle: set[int] = set()  # Components that have answered so since the newest sign
        self._answered_at: dict[int, float] = {}
        self._given_up: set[int] = set()  # Silent ones that have shown no sign of work
        self._workers: set[int] = set()  # Cameras that have shown signs of work
        self.pictures: set[int] = set()

    @property
    def verdict(self) -> Verdict:
        """Judge by what was heard so far."""
        if self._signs_at is None:
            return Verdict.UNHEARD
        if not self._cameras - self._given_up <= self._idle:
            return Verdict.AT_WORK
        return Verdict.DONE if self.pictures else Verdict.NOTHING_DONE

    def receive(self, message: Message, now: float) -> None:
        """Take a message of the vehicle or of its camera."""
        match message.get_type():
            case "COMMAND_ACK" if message.command == self._order:
                if message.result == mavlink.MAV_RESULT_IN_PROGRESS:
                    self._works(message, now)
            case "CAMERA_IMAGE_CAPTURED" if self._is_new(message):
                self.pictures.add(message.image_index)
                self._works(message, now)
            case "CAMERA_CAPTURE_STATUS" if self._is_asked_for(message):
                self._answered_at[source_of(message).component] = now
                if message.image_status == _IDLE:
                    self._idle.add(source_of(message).component)
                else:
                    self._idle.discard(source_of(message).component)

    def tick(self, now: float) -> list[Message]:
        """Ask the camera, once it has fallen silent."""
        if self._signs_at is None or now - self._signs_at < SILENT_AFTER_S:
            return []
        if self._asked_at is not None and now - self._asked_at < ASK_EVERY_S:
            return []
        self._asked_at = now
        if self._asked_since is None:
            self._asked_since = now
        command = mavlink.MAV_CMD_REQUEST_MESSAGE
        return [
            long_command(command, _STATUS, component=component).message(self._vehicle.route, 0)
            for component in sorted(self._cameras)
        ]

    def fault(self, now: float) -> str | None:
        """Why it will never be known how the order ended; None while it may be, or is.

        To be called while messages of the vehicle arrive; a link that was away has `rest` called.
        """
        silent = self._silent(now)
        if not silent:
            return None
        others = self._cameras - silent
        if self.pictures and self._workers and self._workers <= others:
            self._given_up = silent
            return None
        names = ", ".join(str(component) for component in sorted(silent))
        return f"camera {names} has not reported for {PATIENCE_S:.0f} s whether it has ended"

    def rest(self) -> None:
        """Blame no camera for a link that is away."""
        self._asked_since = None

    def _silent(self, now: float) -> set[int]:
        """Cameras that were asked in vain for too long."""
        since = self._asked_since
        if since is None or now - since < PATIENCE_S:
            return set()
        answered = {c for c, at in self._answered_at.items() if now - at < PATIENCE_S}
        return self._cameras - answered

    def _works(self, message: Message, now: float) -> None:
        self._signs_at = now
        self._asked_at = self._asked_since = None
        self._idle.clear()
        self._given_up = set()
        self._workers |= {source_of(message).component} & self._cameras

    @property
    def _cameras(self) -> set[int]:
        return self._vehicle.cameras or {mavlink.MAV_COMP_ID_CAMERA}

    def _is_new(self, message: Message) -> bool:
        """Whether a picture was taken since the order, by the vehicle's clock."""
        taken_s = self._vehicle.snapshot.since_boot_s(message.time_boot_ms)
        return self._began_s is not None and taken_s >= self._began_s

    def _is_asked_for(self, message: Message) -> bool:
        return self._asked_at is not None and source_of(message).component in self._cameras
