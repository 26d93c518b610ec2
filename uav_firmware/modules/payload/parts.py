"""State of camera and gimbal, shared by the handlers of orders."""

from collections import deque
from dataclasses import dataclass, field

from uav_firmware.cal.camera import Gaze, Seeker
from uav_firmware.modules.payload.camera.camera import Camera
from uav_firmware.modules.payload.camera.gimbal import Aim, Gimbal, GimbalControl
from uav_firmware.modules.payload.camera.lens import lens
from uav_firmware.modules.payload.camera.panorama import Panorama
from uav_firmware.modules.payload.camera.storage import JPEG_BYTES_PER_PIXEL, CaptureLog, Storage
from uav_firmware.modules.payload.camera.tracking import Tracker
from uav_firmware.modules.payload.params import PayloadParams
from uav_firmware.msg.payload import CameraEvent
from uav_firmware.msg.status import VehicleCommand
from uav_firmware.msg.vectors import Quaternion


@dataclass(slots=True)
class PanoramaWork:
    """A panorama in progress."""

    panorama: Panorama
    command: VehicleCommand  # The command to acknowledge
    previous_aim: Aim  # Restored at the end
    reported_us: int  # [us] When progress was last reported
    has_rested: bool = False  # The vehicle holds its position since


@dataclass(slots=True)
class Parts:
    """Camera, gimbal, tracker and their shared state."""

    params: PayloadParams
    storage: Storage
    seeker: Seeker | None = None  # Finds moving subjects in the picture
    stream_uri: str = ""  # Of the live view; empty without one
    is_streaming: bool = False
    q_ned_frd: Quaternion = (1.0, 0.0, 0.0, 0.0)  # Attitude of the vehicle
    images_url: str = ""  # Of the folder of the device's pictures
    camera: Camera = field(default_factory=Camera)
    gimbal: Gimbal = field(default_factory=Gimbal)
    control: GimbalControl = field(default_factory=GimbalControl)
    tracker: Tracker = field(default_factory=Tracker)
    capture_log: CaptureLog = field(default_factory=CaptureLog)
    panorama: PanoramaWork | None = None
    neutral: bool = True  # No order has pointed the gimbal
    mission_orders: deque[VehicleCommand] = field(default_factory=deque)
    events: list[CameraEvent] = field(default_factory=list)  # To publish
    erase_due: bool = False  # The device's pictures must be removed
    storing: int = 0  # Pictures exposed and not stored yet
    is_filming: bool = False  # A video file is open or not fully stored

    @property
    def picture_bytes(self) -> float:
        """Estimated size of a picture [B] before a device stores it."""
        width = self.params.image_width_px
        return width * (width * 3 // 4) * JPEG_BYTES_PER_PIXEL

    @property
    def gaze(self) -> Gaze:
        """Where the camera points."""
        params = self.params
        return Gaze(lens(params.image_width_px), self.gimbal.q_ned_camera, self.q_ned_frd)

    @property
    def has_space(self) -> bool:
        """Whether one more picture fits, besides those being stored."""
        return self.storage.has_space(self.picture_bytes * (1 + self.storing))

    def point(self, aim: Aim) -> None:
        """Point the gimbal by order, which ends tracking."""
        self.tracker.stop()
        self.neutral = False
        self.gimbal.follow(aim)
