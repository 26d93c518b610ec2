"""Video: recording to files, and the live view."""

from typing import Final

from uav_firmware.cal.camera import Exposure, Recorder, Streamer
from uav_firmware.modules.payload.parts import Parts
from uav_firmware.modules.payload.pictures import PublishText, exposure_of, reason_of
from uav_firmware.modules.payload.situation import Situation
from uav_firmware.msg.vectors import Quaternion

_NOT_RECORDING: Final = -1


class VideoRecording:
    """Writes a file per recording; without a recorder only the status changes."""

    def __init__(
        self,
        parts: Parts,
        recorder: Recorder | None,
        boot_time_utc_us: int,
        publish_text: PublishText,
    ) -> None:
        self._parts = parts
        self._recorder = recorder
        self._boot_time_utc_us = boot_time_utc_us
        self._publish_text = publish_text
        self._since_us = _NOT_RECORDING  # Start of the open file
        self._frame_us = 0  # When the next frame is due
        self._interval_us = 0
        self._width_px = 0  # Of the open file; parameter changes apply to the next
        self._number = 0

    def update(self, situation: Situation, q_ned_frd: Quaternion) -> None:
        """Start, continue or end a file."""
        recorder = self._recorder
        if recorder is None:
            return
        self._count_bytes(recorder, situation.now_us)
        wanted_us = self._parts.camera.recording_since_us
        try:
            if self._since_us not in (wanted_us, _NOT_RECORDING):
                self._since_us = _NOT_RECORDING
                recorder.end_film()
            if wanted_us != _NOT_RECORDING:
                self._record(recorder, situation, q_ned_frd)
        except OSError as error:
            self._stop_with_error(situation.now_us, reason_of(error))
        self._parts.is_filming = self._since_us != _NOT_RECORDING or recorder.is_busy

    def _record(self, recorder: Recorder, situation: Situation, q_ned_frd: Quaternion) -> None:
        now_us = situation.now_us
        if self._since_us == _NOT_RECORDING:
            params = self._parts.params
            self._since_us = self._parts.camera.recording_since_us
            self._interval_us = round(1e6 / params.video_rate_hz)
            self._width_px = params.video_width_px
            self._frame_us = now_us + self._interval_us
            self._number += 1
            place = recorder.begin_film(self._exposure(situation, q_ned_frd), params.video_rate_hz)
            self._publish_text(now_us, f"Video {'/'.join(place)}")
        elif now_us >= self._frame_us:
            self._frame_us += self._interval_us
            recorder.add_frame(self._exposure(situation, q_ned_frd))

    def _exposure(self, situation: Situation, q_ned_frd: Quaternion) -> Exposure:
        return exposure_of(
            self._parts,
            situation,
            q_ned_frd,
            boot_time_utc_us=self._boot_time_utc_us,
            image_index=self._number,
            width_px=self._width_px,
        )

    def _count_bytes(self, recorder: Recorder, now_us: int) -> None:
        """Count the stored bytes; end the recording when the storage is full."""
        growth = recorder.film_growth()
        self._parts.storage.add(growth.size_bytes)
        if growth.reason:
            self._stop_with_error(now_us, growth.reason)
        elif self._since_us != _NOT_RECORDING and not self._parts.has_space:
            self._stop_with_error(now_us, "the storage is full")

    def _stop_with_error(self, now_us: int, reason: str) -> None:
        if self._parts.camera.recording_since_us != _NOT_RECORDING:
            self._publish_text(now_us, f"Video ended: {reason}")
        self._parts.camera.stop_video()


class LiveView:
    """Streams frames while `Parts.is_streaming`, at the size and rate of the video parameters."""

    def __init__(
        self,
        parts: Parts,
        streamer: Streamer | None,
        boot_time_utc_us: int,
        publish_text: PublishText,
    ) -> None:
        self._parts = parts
        self._streamer = streamer
        self._boot_time_utc_us = boot_time_utc_us
        self._publish_text = publish_text
        self._frame_us = 0  # When the next frame is due
        self._is_shown = False
        parts.stream_uri = "" if streamer is None else streamer.uri
        parts.is_streaming = streamer is not None and streamer.starts_at_once

    def update(self, situation: Situation, q_ned_frd: Quaternion) -> None:
        """Send a frame if one is due."""
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
            self._publish_text(now_us, f"Live view ended: {reason}")
