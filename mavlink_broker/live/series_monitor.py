"""Waits for the pictures of a command that has ended before the next command begins.

A camera may begin late, because its gimbal still turns, and a series of pictures that a mission has
begun pauses while the mission is not flown: a live command that begins too early finds the camera
busy, and interrupts the series. So the broker requests CAMERA_CAPTURE_STATUS until image_status is
idle. It does not wait if no camera is known, or none answers.
"""

from typing import Final

from afarcloud.commands import CameraImage, Command
from mavlink_broker.mavlink.dialect import Message, mavlink, source_of
from mavlink_broker.microservices.command import long_command
from mavlink_broker.vehicle.vehicle import Vehicle

REQUEST_EVERY_S: Final = 0.5
SILENT_AFTER_S: Final = 5.0
"""The broker does not wait longer for a camera that does not answer."""
EXTRA_S: Final = 20.0
"""Beyond the duration of the series itself."""
_STATUS: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS
_IDLE: Final = 0


class SeriesMonitor:
    """The cameras of one vehicle after one command."""

    def __init__(self, command: Command, vehicle: Vehicle) -> None:
        """Wait for the pictures of a command; commands without pictures are over at once."""
        self._vehicle = vehicle
        self._timeout_s = 0.0
        if isinstance(command, CameraImage):
            p = command.parameters
            self._timeout_s = p.photo_count * max(1.0, p.time_interval) + EXTRA_S
        self._began_at: float | None = None  # By the broker's clock
        self._began_s: float | None = None  # By the vehicle's, once it has one
        self._requested_at: float | None = None
        self._answered_at = 0.0
        self._busy = set(vehicle.cameras)

    def receive(self, message: Message, now: float) -> None:
        """Process the answer of a camera."""
        if message.get_type() != "CAMERA_CAPTURE_STATUS" or self._requested_at is None:
            return
        component = source_of(message).component
        self._answered_at = now
        if message.image_status == _IDLE:
            self._busy.discard(component)

    def tick(self, now: float) -> list[Message]:
        """Request the state of the cameras that are not known to be idle."""
        if self._began_at is None:
            self._began_at = self._answered_at = now
        time_s = self._vehicle.snapshot.time_s
        if self._began_s is None and time_s is not None:
            self._began_s = time_s - (now - self._began_at)
        if self.is_over(now) or (
            self._requested_at is not None and now - self._requested_at < REQUEST_EVERY_S
        ):
            return []
        self._requested_at = now
        route = self._vehicle.route
        request = mavlink.MAV_CMD_REQUEST_MESSAGE
        return [
            long_command(request, _STATUS, component=component).message(route, 0)
            for component in sorted(self._busy)
        ]

    def is_over(self, now: float) -> bool:
        """Whether the next command may begin."""
        if self._timeout_s == 0.0 or not self._busy:
            return True
        if self._began_at is None:
            return False
        is_silent = now - self._answered_at >= SILENT_AFTER_S
        time_s = self._vehicle.snapshot.time_s
        if time_s is None or self._began_s is None:
            lasted_s = now - self._began_at
        else:
            lasted_s = time_s - self._began_s
        return is_silent or lasted_s >= self._timeout_s
