"""The parts of the payload, put together once."""

from collections import deque
from dataclasses import dataclass, field

from uav_firmware.cal.camera import Gaze, Seeker
from uav_firmware.modules.payload.camera.camera import Camera
from uav_firmware.modules.payload.camera.capture_log import CaptureLedger
from uav_firmware.modules.payload.camera.lens import lens
from uav_firmware.modules.payload.camera.panorama import Panorama
from uav_firmware.modules.payload.camera.storage import JPEG_BYTES_PER_PIXEL, Storage
from uav_firmware.modules.payload.gimbal.control import GimbalControl
from uav_firmware.modules.payload.gimbal.gimbal import Aim, Gimbal
from uav_firmware.modules.payload.params import PayloadParams
from uav_firmware.modules.payload.tracking import Tracker
from uav_firmware.msg.payload import CameraEvent
from uav_firmware.msg.status import VehicleCommand
from uav_firmware.msg.vectors import Quaternion


@dataclass(slots=True)
class PanoramaWork:
    """A panorama under way."""

    panorama: Panorama
    command: VehicleCommand  # That it answers
    former_aim: Aim  # To go back to
    told_us: int  # [us] When progress was last reported


@dataclass(slots=True)
class Parts:
    """Camera, gimbal and what belongs to them."""

    params: PayloadParams
    storage: Storage
    seeker: Seeker | None = None  # Finds moving things in the picture
    stream_uri: str = ""  # Of the live view; empty when there is none
    is_streaming: bool = False
    q_ned_frd: Quaternion = (1.0, 0.0, 0.0, 0.0)  # Attitude that the gimbal works against
    images_url: str = ""  # Of the folder that the device's pictures lie in
    camera: Camera = field(default_factory=Camera)
    gimbal: Gimbal = field(default_factory=Gimbal)
    control: GimbalControl = field(default_factory=GimbalControl)
    tracker: Tracker = field(default_factory=Tracker)
    ledger: CaptureLedger = field(default_factory=CaptureLedger)
    panorama: PanoramaWork | None = None
    neutral: bool = True  # Nobody has pointed the gimbal
    mission_orders: deque[VehicleCommand] = field(default_factory=deque)
    events: list[CameraEvent] = field(default_factory=list)  # To publish
    erase_due: bool = False  # The device's pictures are to be removed
    storing: int = 0  # Pictures that are exposed and not stored yet
    is_filming: bool = False  # A film is open, or frames of one are not stored yet

    @property
    def picture_bytes(self) -> float:
        """Size of a picture [B] that no device has stored yet."""
        width = self.params.image_width_px
        return width * (width * 3 // 4) * JPEG_BYTES_PER_PIXEL

    @property
    def gaze(self) -> Gaze:
        """Where the camera points."""
        params = self.params
        return Gaze(lens(params.image_width_px), self.gimbal.q_ned_camera, self.q_ned_frd)

    @property
    def has_room(self) -> bool:
        """Whether one more picture fits, besides those that are being stored."""
        return self.storage.has_room(self.picture_bytes * (1 + self.storing))

    def point(self, aim: Aim) -> None:
        """Turn the gimbal on somebody's order, which ends tracking."""
        self.tracker.stop()
        self.neutral = False
        self.gimbal.follow(aim)
