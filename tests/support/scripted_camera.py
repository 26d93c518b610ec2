"""A camera component of a scripted vehicle: takes pictures, loses announcements, gives files.

It is a component beside its `ScriptedVehicle` and receives the same frames.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from tests.support.file_server import ScriptedFiles
from tests.support.vehicle_wire import Message, VehicleWire, mavlink

JPEG: Final = b"\xff\xd8\xff" + bytes(range(256)) * 20


@dataclass
class ScriptedCamera:
    """One camera; `put` sends its frames, `boot_ms` is its clock."""

    system: int
    put: Callable[[bytes], None]
    boot_ms: Callable[[], int]
    component: int = mavlink.MAV_COMP_ID_CAMERA
    files: ScriptedFiles = field(default_factory=ScriptedFiles)
    url: str = "mftp:///image/{index}.jpg"
    contents: bytes = JPEG
    first_index: int = 0
    place_e7: tuple[int, int] = (0, 0)  # Latitude and longitude; it does not know them
    image_status: int = 0  # Of CAMERA_CAPTURE_STATUS; 0: idle
    is_silent: bool = False  # It answers no questions about its pictures
    taken: list[Message] = field(default_factory=list)
    asked: list[tuple[int, int]] = field(default_factory=list)  # REQUEST_MESSAGE's p1 and p2

    def __post_init__(self) -> None:
        self._wire = VehicleWire(self.system, self.component)

    def heartbeat(self) -> None:
        """Send a HEARTBEAT."""
        self._send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_CAMERA, 8, 0, 0, 4, 3))

    def shoot(
        self, *, announced: bool = True, succeeded: bool = True, taken_ms: int | None = None
    ) -> int:
        """Take a picture; gives its number. `taken_ms` if it was taken before, and stored now."""
        taken_ms = self.boot_ms() if taken_ms is None else taken_ms
        index = self.first_index + len(self.taken)
        path = f"/image/{index}.jpg"
        if succeeded:
            self.files.files = {**self.files.files, path: self.contents + bytes([index % 256])}
        message = mavlink.MAVLink_camera_image_captured_message(
            taken_ms,
            1_790_000_000_000_000 + taken_ms * 1000,
            *(0, *self.place_e7, 655_000, 5_000),
            [1.0, 0.0, 0.0, 0.0],
            index,
            int(succeeded),
            self.url.format(index=index).encode() if succeeded else b"",
        )
        self.taken.append(message)
        if announced:
            self._send(message)
        return index

    def receive(self, frame: bytes) -> None:
        """Take what the broker sent to the vehicle."""
        for message in self._wire.decode(frame):
            for_us = getattr(message, "target_component", 0) in {0, self.component}
            if not for_us:
                continue
            if message.get_type() == "COMMAND_LONG":
                self._command(message)
            for answer in self.files.answers(message):
                self._send(answer)

    def _command(self, message: Message) -> None:
        if message.command != mavlink.MAV_CMD_REQUEST_MESSAGE:
            return
        wanted, number = int(message.param1), int(message.param2)
        self.asked.append((wanted, number))
        if self.is_silent:
            return
        if wanted == mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS:
            count = self.first_index + len(self.taken)
            self._send(
                mavlink.MAVLink_camera_capture_status_message(
                    self.boot_ms(), self.image_status, 0, 0.0, 0, 1000.0, count
                )
            )
        place = number - self.first_index
        is_image = wanted == mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED
        if is_image and 0 <= place < len(self.taken):
            self._send(self.taken[place])

    def _send(self, message: Message) -> None:
        self.put(self._wire.encode(message))
