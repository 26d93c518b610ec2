"""Has a camera stop tracking when no command of the broker wants it any more.

A command that ends as planned stops it itself. One that ends otherwise (an abort, a failure, a
pause, a restart of the broker) leaves the camera on its subject: its gimbal would turn the pictures
of the next mission there.
"""

import logging
import math
from typing import Final

from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import CommandSequence
from mavlink_broker.planning.target_commands import stop_tracking
from mavlink_broker.vehicle.vehicle import Vehicle

AGAIN_AFTER_S: Final = 10.0
ATTEMPTS: Final = 5
"""Each repeats its command some times."""

_STOPPED: Final = frozenset(
    {mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED, mavlink.MAV_RESULT_UNSUPPORTED}
)
"""Results of a camera that tracks nothing any more; others are repeated."""

_LOG = logging.getLogger(__name__)


class TrackingStop:
    """The camera of one vehicle; that it tracks for the broker is in the recovery state."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._sequence: CommandSequence | None = None
        self._attempts = 0
        self._again_at = -math.inf

    def receive(self, message: Message, now: float) -> list[Message]:
        """Process an answer, also to a stop at the planned end of a command."""
        if message.get_type() != "COMMAND_ACK" or not self._vehicle.route.is_for_us(message):
            return []
        is_stop = message.command == mavlink.MAV_CMD_CAMERA_STOP_TRACKING
        if is_stop and message.result in _STOPPED:
            self._vehicle.recovery.clear_tracking()
        return [] if self._sequence is None else self._sequence.receive(message, now)

    def tick(self, now: float, *, is_wanted: bool) -> list[Message]:
        """Stop it, unless a command wants it to track, or may be continued."""
        if is_wanted or not self._vehicle.recovery.is_tracking:
            self._sequence, self._attempts, self._again_at = None, 0, -math.inf
            return []
        if self._sequence is not None:
            messages = self._sequence.tick(now)
            if self._sequence.outcome is not None:
                self._end_attempt(now)
            return messages
        if now < self._again_at:
            return []
        self._attempts += 1
        self._sequence = self._vehicle.sequence(((stop_tracking(self._vehicle.family),),))
        return self._sequence.start(now)

    def _end_attempt(self, now: float) -> None:
        """Try again later, some times: nobody has answered, or not yet."""
        self._sequence, self._again_at = None, now + AGAIN_AFTER_S
        if self._attempts >= ATTEMPTS:
            _LOG.warning(
                "vehicle %d: its camera may still track a subject: it does not stop",
                self._vehicle.vehicle_id,
            )
            self._vehicle.recovery.clear_tracking()
