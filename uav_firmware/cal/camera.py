"""What takes the pictures, where a vehicle has something that does."""

from typing import NamedTuple, Protocol

from uav_firmware.msg.payload import CameraLens
from uav_firmware.msg.vectors import Quaternion


class Exposure(NamedTuple):
    """How and where a picture is taken, as the vehicle believes; written into the picture."""

    time_utc_us: int  # [us since 1970] 0 unknown
    image_index: int  # [-] In the log of captures
    lens: CameraLens
    latitude_deg: float  # [deg] NaN unknown
    longitude_deg: float  # [deg]
    altitude_amsl_m: float  # [m]
    relative_altitude_m: float  # [m] Above home
    q_ned_camera: Quaternion  # [-] Optical axis forward, right, down to NED


class Picture(NamedTuple):
    """A picture that has been stored."""

    file_url: str  # Where it can be fetched
    size_bytes: int


class CameraDevice(Protocol):
    """A camera with its storage."""

    def expose(self, exposure: Exposure) -> Picture:
        """Take and store a picture.

        Raises:
            OSError: if the camera or its storage fails; nothing is stored then.
        """

    def erase(self) -> None:
        """Remove all pictures.

        Raises:
            OSError: if the storage refuses.
        """
