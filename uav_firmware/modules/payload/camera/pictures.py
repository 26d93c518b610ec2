"""From the shutter to the report: what is exposed is told once, when it is stored or lost."""

from collections.abc import Callable
from typing import Final

from uav_firmware.cal.camera import CameraDevice, Exposure, Outcome
from uav_firmware.modules.payload.camera.exposure import exposure_of
from uav_firmware.modules.payload.camera.storage import MIB
from uav_firmware.modules.payload.parts import Parts
from uav_firmware.modules.payload.situation import Situation
from uav_firmware.msg.payload import ImageCaptured
from uav_firmware.msg.vectors import Quaternion

Say = Callable[[int, str], None]
"""Tells the operator something, at a time [us]."""

_FULL: Final = "Camera storage is full"


class Pictures:
    """Exposes with the device, or reckons pictures where there is none.

    Reports keep the order of the exposures, whichever of them fail.
    """

    def __init__(
        self, parts: Parts, device: CameraDevice | None, boot_time_utc_us: int, say: Say
    ) -> None:
        self._parts = parts
        self._device = device
        self._boot_time_utc_us = boot_time_utc_us
        self._say = say
        self._told: dict[int, ImageCaptured] = {}  # By index: what will be reported
        self._ended: set[int] = set()
        self._full_told = False
        self._seen_bytes = 0  # On the card when it was last looked at
        self._look_at_storage(0)

    def expose(self, situation: Situation, q_ned_frd: Quaternion) -> None:
        """Take a picture, whether it succeeds or not."""
        parts, now_us = self._parts, situation.now_us
        exposure = exposure_of(
            parts,
            situation,
            q_ned_frd,
            boot_time_utc_us=self._boot_time_utc_us,
            image_index=parts.ledger.next_index(),
            width_px=parts.params.image_width_px,
        )
        index = exposure.image_index
        self._told[index] = ImageCaptured(
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
        """Take what the device has stored, and report it."""
        device = self._device
        if device is None:
            return
        for outcome in device.collect(now_us):
            self._take(outcome, now_us)
        self._parts.camera.memory_full = not device.is_ready
        self._note_removals(device)
        self._parts.camera.answers = device.answers

    def erase(self, now_us: int) -> None:
        """Remove pictures from the device, some at each call while `Parts.erase_due` holds."""
        self._parts.erase_due = self._full_told = False
        if self._device is None:
            return
        try:
            self._parts.erase_due = not self._device.erase()
        except OSError as error:
            self._say(now_us, f"Camera storage cannot be formatted: {reason_of(error)}")
        self._look_at_storage(now_us)

    def _begin(self, device: CameraDevice, exposure: Exposure) -> None:
        try:
            device.expose(exposure)
        except OSError as error:
            self._say(exposure.time_us, f"Camera failed: {reason_of(error)}")
            self._end(exposure.image_index, url="", succeeded=False)
        else:
            self._parts.storing = len(self._told) - len(self._ended)

    def _take(self, outcome: Outcome, now_us: int) -> None:
        picture = outcome.picture
        if picture is None:
            self._say(now_us, f"Picture {outcome.image_index} lost: {outcome.reason}")
            self._end(outcome.image_index, url="", succeeded=False)
            return
        self._parts.storage.add(picture.size_bytes)
        url = "/".join((self._parts.images_url, *picture.place))
        self._end(outcome.image_index, url=url, succeeded=True)
        self._stop_when_full(now_us)

    def _end(self, index: int, *, url: str, succeeded: bool) -> None:
        """Note the end of a picture, and report those whose turn it is."""
        self._told[index] = self._told[index]._replace(succeeded=succeeded, file_url=url)
        self._ended.add(index)
        while self._told and (first := next(iter(self._told))) in self._ended:
            self._ended.remove(first)
            self._parts.events.append(self._told.pop(first))
        self._parts.storing = len(self._told) - len(self._ended)

    def _stop_when_full(self, now_us: int) -> None:
        if self._parts.has_room:
            self._full_told = False
            return
        self._parts.camera.stop()
        if not self._full_told:
            self._full_told = True
            self._say(now_us, _FULL)

    def _note_removals(self, device: CameraDevice) -> None:
        """Give back the room of files that somebody has removed from the card."""
        try:
            used = device.used_bytes
        except OSError:
            return  # It was told when the card was first looked at
        if used < self._seen_bytes:
            self._parts.storage.remove(self._seen_bytes - used)
        self._seen_bytes = used

    def _look_at_storage(self, now_us: int) -> None:
        """Begin with the room that is taken already."""
        if self._device is None:
            return
        try:
            self._seen_bytes = self._device.used_bytes
            self._parts.storage.used_mib = self._seen_bytes / MIB
        except OSError as error:
            self._say(now_us, f"Camera storage cannot be read: {reason_of(error)}")


def reason_of(error: OSError) -> str:
    """A sentence for the operator."""
    return error.strerror or str(error)
