"""Takes pictures and reports each one once, when it is stored or lost."""

import math
from collections.abc import Callable
from typing import Final

from uav_firmware.cal.camera import CameraDevice, Exposure, Outcome, SecondPicture
from uav_firmware.cal.files import Place
from uav_firmware.modules.payload.camera.lens import lens
from uav_firmware.modules.payload.camera.storage import MIB
from uav_firmware.modules.payload.parts import Parts
from uav_firmware.modules.payload.situation import NOWHERE, Situation
from uav_firmware.msg.payload import ImageCaptured
from uav_firmware.msg.vectors import Quaternion

PublishText = Callable[[int, str], None]
"""Publishes a status text at a time [us]."""
_FULL: Final = "Camera storage is full"


def exposure_of(
    parts: Parts,
    situation: Situation,
    q_ned_frd: Quaternion,
    *,
    boot_time_utc_us: int,
    image_index: int,
    width_px: int,
) -> Exposure:
    """Describe a picture taken now, `width_px` wide; a UTC time of 0 is unknown."""
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


class Pictures:
    """Exposes with the device; without one it only counts pictures and their estimated size.

    Reports have the order of the exposures, also when some fail.
    """

    def __init__(
        self,
        parts: Parts,
        device: CameraDevice | None,
        boot_time_utc_us: int,
        publish_text: PublishText,
    ) -> None:
        self._parts = parts
        self._device = device
        self._boot_time_utc_us = boot_time_utc_us
        self._publish_text = publish_text
        self._pending: dict[int, ImageCaptured] = {}  # Reports not published yet, by index
        self._ended: set[int] = set()
        self._full_reported = False
        self._used_bytes = 0  # Used on the device at the last check
        self._read_storage(0)

    def expose(self, situation: Situation, q_ned_frd: Quaternion) -> None:
        """Take a picture."""
        parts, now_us = self._parts, situation.now_us
        exposure = exposure_of(
            parts,
            situation,
            q_ned_frd,
            boot_time_utc_us=self._boot_time_utc_us,
            image_index=parts.capture_log.next_index(),
            width_px=parts.params.image_width_px,
        )
        index = exposure.image_index
        self._pending[index] = ImageCaptured(
            now_us,
            index,
            exposure.latitude_deg,
            exposure.longitude_deg,
            exposure.altitude_amsl_m,
            exposure.relative_altitude_m,
            exposure.q_ned_camera,
            succeeded=False,
            file_url="",
        )
        if self._device is None:
            parts.storage.add(parts.picture_bytes)
            self._end(index, url="", succeeded=True)
        else:
            self._begin(self._device, exposure)
        self._stop_when_full(now_us)

    def collect(self, now_us: int) -> None:
        """Report the pictures that the device has stored or lost."""
        device = self._device
        if device is None:
            return
        for outcome in device.collect(now_us):
            self._handle_outcome(outcome, now_us)
        self._parts.camera.memory_full = not device.is_ready
        self._note_removals(device)
        self._parts.camera.answers = device.answers

    def erase(self, now_us: int) -> None:
        """Remove pictures from the device, some per call until `Parts.erase_due` is false."""
        self._parts.erase_due = self._full_reported = False
        if self._device is None:
            return
        try:
            self._parts.erase_due = not self._device.erase()
        except OSError as error:
            self._publish_text(now_us, f"Camera storage cannot be formatted: {reason_of(error)}")
        self._read_storage(now_us)

    def _begin(self, device: CameraDevice, exposure: Exposure) -> None:
        try:
            device.expose(exposure)
        except OSError as error:
            self._publish_text(exposure.time_us, f"Camera failed: {reason_of(error)}")
            self._end(exposure.image_index, url="", succeeded=False)
        else:
            self._parts.storing = len(self._pending) - len(self._ended)

    def _handle_outcome(self, outcome: Outcome, now_us: int) -> None:
        picture = outcome.picture
        if picture is None:
            self._publish_text(now_us, f"Picture {outcome.image_index} lost: {outcome.reason}")
            self._end(outcome.image_index, url="", succeeded=False)
            return
        self._parts.storage.add(picture.size_bytes)
        second_url = "" if picture.second_place is None else self._url(picture.second_place)
        self._end(
            outcome.image_index,
            url=self._url(picture.place),
            succeeded=True,
            second_url=second_url,
        )
        self._stop_when_full(now_us)

    def _url(self, place: Place) -> str:
        return "/".join((self._parts.images_url, *place))

    def _end(self, index: int, *, url: str, succeeded: bool, second_url: str = "") -> None:
        """Complete a picture, and report completed ones in order."""
        self._pending[index] = self._pending[index]._replace(
            succeeded=succeeded, file_url=url, second_file_url=second_url
        )
        self._ended.add(index)
        while self._pending and (first := next(iter(self._pending))) in self._ended:
            self._ended.remove(first)
            picture = self._pending.pop(first)
            if picture.second_file_url:
                second_index = self._parts.capture_log.next_second_index()
                picture = picture._replace(second_index=second_index)
            self._parts.events.append(picture)
        self._parts.storing = len(self._pending) - len(self._ended)

    def _stop_when_full(self, now_us: int) -> None:
        if self._parts.has_space:
            self._full_reported = False
            return
        self._parts.camera.stop()
        if not self._full_reported:
            self._full_reported = True
            self._publish_text(now_us, _FULL)

    def _note_removals(self, device: CameraDevice) -> None:
        """Subtract the size of files that were removed from the device by others."""
        try:
            used = device.used_bytes
        except OSError:
            return  # Reported at the first check
        if used < self._used_bytes:
            self._parts.storage.remove(self._used_bytes - used)
        self._used_bytes = used

    def _read_storage(self, now_us: int) -> None:
        """Read the space that is used on the device."""
        if self._device is None:
            return
        try:
            self._used_bytes = self._device.used_bytes
            self._parts.storage.used_mib = self._used_bytes / MIB
        except OSError as error:
            self._publish_text(now_us, f"Camera storage cannot be read: {reason_of(error)}")


def reason_of(error: OSError) -> str:
    """Reason for the operator."""
    return error.strerror or str(error)
