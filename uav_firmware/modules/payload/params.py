"""Parameters of camera and gimbal."""

from dataclasses import dataclass

from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class PayloadParams:
    """Rates of the gimbal, size of pictures and storage."""

    gimbal_rate_max_deg: float = param(
        "MNT_SLEW_MAX", 90.0, unit="deg/s", minimum=5.0, maximum=360.0,
        short="Largest rate of the gimbal in pitch and yaw",
    )  # fmt: skip
    manual_rate_pitch_deg: float = param(
        "MNT_RATE_PITCH", 30.0, unit="deg/s", minimum=1.0, maximum=90.0,
        short="Pitch rate of the gimbal at full deflection of its manual control",
    )  # fmt: skip
    manual_rate_yaw_deg: float = param(
        "MNT_RATE_YAW", 30.0, unit="deg/s", minimum=1.0, maximum=90.0,
        short="Yaw rate of the gimbal at full deflection of its manual control",
    )  # fmt: skip
    image_width_px: int = param(
        "CAM_IMAGE_WIDTH", 2048, unit="px", minimum=1152, maximum=4000,
        short="Width of pictures, which are three quarters as high",
    )  # fmt: skip
    second_picture: int = param(
        "CAM_IMAGE_SECOND", 0, unit="-", minimum=0, maximum=2,
        short="Stored beside each picture",
        values={0: "nothing", 1: "near infrared", 2: "vegetation index (NDVI)"},
    )  # fmt: skip
    video_width_px: int = param(
        "CAM_VIDEO_WIDTH", 480, unit="px", minimum=160, maximum=1280,
        short="Width of video, which is three quarters as high",
    )  # fmt: skip
    video_rate_hz: float = param(
        "CAM_VIDEO_RATE", 4.0, unit="Hz", minimum=0.2, maximum=12.5,
        short="Frame rate of a video; read when it starts",
    )  # fmt: skip
    storage_mib: float = param(
        "CAM_STORAGE_SIZE", 16384.0, unit="MiB", minimum=1.0, maximum=1048576.0,
        short="Size of the storage for pictures; read at start and at each format",
    )  # fmt: skip
