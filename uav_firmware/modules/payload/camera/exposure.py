"""Where and how the camera looks at a moment, as the vehicle believes."""

import math

from uav_firmware.cal.camera import Exposure, SecondPicture
from uav_firmware.modules.payload.camera.lens import lens
from uav_firmware.modules.payload.parts import Parts
from uav_firmware.modules.payload.situation import NOWHERE, Situation
from uav_firmware.msg.vectors import Quaternion


def exposure_of(
    parts: Parts,
    situation: Situation,
    q_ned_frd: Quaternion,
    *,
    boot_time_utc_us: int,
    image_index: int,
    width_px: int,
) -> Exposure:
    """What the camera sees now, `width_px` wide; a time of 0 is unknown."""
    now_us, position, home = situation.now_us, situation.position_ned, situation.home
    place = NOWHERE if position is None else situation.to_geodetic(position)
    return Exposure(
        now_us,
        boot_time_utc_us + now_us if boot_time_utc_us else 0,
        image_index,
        lens(width_px),
        *place,
        math.nan if home is None else place[2] - home.altitude_amsl_m,
        parts.gimbal.q_ned_camera,
        q_ned_frd,
        SecondPicture(parts.params.second_picture),
    )
