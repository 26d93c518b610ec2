"""The live view: frames of what the camera sees while it is told to stream."""

from uav_firmware.cal.camera import Streamer
from uav_firmware.modules.payload.camera.exposure import exposure_of
from uav_firmware.modules.payload.camera.pictures import Say, reason_of
from uav_firmware.modules.payload.parts import Parts
from uav_firmware.modules.payload.situation import Situation
from uav_firmware.msg.vectors import Quaternion


class LiveView:
    """Follows `Parts.is_streaming`, and what the video's parameters say of size and rate."""

    def __init__(
        self, parts: Parts, streamer: Streamer | None, boot_time_utc_us: int, say: Say
    ) -> None:
        self._parts = parts
        self._streamer = streamer
        self._boot_time_utc_us = boot_time_utc_us
        self._say = say
        self._frame_us = 0  # When the next frame is due
        self._is_shown = False
        parts.stream_uri = "" if streamer is None else streamer.uri

    def update(self, situation: Situation, q_ned_frd: Quaternion) -> None:
        """Show a frame if one is due."""
        streamer, parts, now_us = self._streamer, self._parts, situation.now_us
        if streamer is None:
            return
        if not parts.is_streaming:
            if self._is_shown:
                self._is_shown = False
                streamer.close()
            return
        if now_us < self._frame_us:
            return
        self._is_shown = True
        due_us = self._frame_us + round(1e6 / parts.params.video_rate_hz)
        self._frame_us = max(now_us, due_us)
        exposure = exposure_of(
            parts,
            situation,
            q_ned_frd,
            boot_time_utc_us=self._boot_time_utc_us,
            image_index=0,
            width_px=parts.params.video_width_px,
        )
        try:
            reason = streamer.show(exposure, parts.params.video_rate_hz)
        except OSError as error:
            reason = reason_of(error)
        if reason:
            parts.is_streaming = False
            self._say(now_us, f"Live view ended: {reason}")
