"""Waits for the pictures of a command that has ended before the next command begins.

A camera may begin late, because its gimbal still turns, and a series that a mission has begun rests
while the mission is not flown: a live command that begins too early finds the camera busy, and cuts
the series. So the camera is asked (CAMERA_CAPTURE_STATUS, image_status) until it says that it is
idle. Where no camera is known, or none answers, nothing is waited for.
"""

from typing import Final

from afarcloud.commands import CameraImage, Command
from mavlink_broker.mavlink.dialect import Message, mavlink, source_of
from mavlink_broker.microservices.command import long_command
from mavlink_broker.vehicle.vehicle import Vehicle

ASK_EVERY_S: Final = 0.5
SILENT_AFTER_S: Final = 5.0
"""A camera that has not answered by then is not waited for."""
PATIENCE_S: Final = 20.0
"""Beyond what its pictures take by themselves."""
_STATUS: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS
_IDLE: Final = 0


class SeriesWatch:
    """The cameras of one vehicle behind one command."""

    def __init__(self, command: Command, vehicle: Vehicle) -> None:
        """Watch for the end of a command's pictures; other commands have none to wait for."""
        self._vehicle = vehicle
        self._within_s = 0.0
        if isinstance(command, CameraImage):
            p = command.parameters
            self._within_s = p.photo_count * max(1.0, p.time_interval) + PATIENCE_S
        self._began_at: float | None = None  # By the broker's clock
        self._began_s: float | None = None  # By the vehicle's, once it has one
        self._asked_at: float | None = None
        self._heard_at = 0.0
        self._busy = set(vehicle.cameras)

    def receive(self, message: Message, now: float) -> None:
        """Take what a camera answers."""
        if message.get_type() != "CAMERA_CAPTURE_STATUS" or self._asked_at is None:
            return
        component = source_of(message).component
        self._heard_at = now
        if message.image_status == _IDLE:
            self._busy.discard(component)

    def tick(self, now: float) -> list[Message]:
        """Ask the cameras that are not known to be idle."""
        if self._began_at is None:
            self._began_at = self._heard_at = now
        time_s = self._vehicle.snapshot.time_s
        if self._began_s is None and time_s is not None:
            self._began_s = time_s - (now - self._began_at)
        if self.is_over(now) or (self._asked_at is not None and now - self._asked_at < ASK_EVERY_S):
            return []
        self._asked_at = now
        route = self._vehicle.route
        ask = mavlink.MAV_CMD_REQUEST_MESSAGE
        return [
            long_command(ask, _STATUS, component=component).message(route, 0)
            for component in sorted(self._busy)
        ]

    def is_over(self, now: float) -> bool:
        """Whether the next command may begin."""
        if self._within_s == 0.0 or not self._busy:
            return True
        if self._began_at is None:
            return False
        is_silent = now - self._heard_at >= SILENT_AFTER_S
        time_s = self._vehicle.snapshot.time_s
        if time_s is None or self._began_s is None:
            lasted_s = now - self._began_at
        else:
            lasted_s = time_s - self._began_s
        return is_silent or lasted_s >= self._within_s
