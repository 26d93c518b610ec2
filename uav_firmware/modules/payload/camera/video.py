"""Video as files: begun with the recording, a frame at the parameter's rate, ended with it."""

from typing import Final

from uav_firmware.cal.camera import Exposure, Recorder
from uav_firmware.modules.payload.camera.exposure import exposure_of
from uav_firmware.modules.payload.camera.pictures import Say, reason_of
from uav_firmware.modules.payload.parts import Parts
from uav_firmware.modules.payload.situation import Situation
from uav_firmware.msg.vectors import Quaternion

_NOT_RECORDING: Final = -1


class Films:
    """Follows the camera's recording; without a recorder the camera only says that it records."""

    def __init__(
        self, parts: Parts, recorder: Recorder | None, boot_time_utc_us: int, say: Say
    ) -> None:
        self._parts = parts
        self._recorder = recorder
        self._boot_time_utc_us = boot_time_utc_us
        self._say = say
        self._since_us = _NOT_RECORDING  # Of the film that is open
        self._frame_us = 0  # When the next frame is due
        self._interval_us = 0
        self._width_px = 0  # Of the film that is open, whatever the parameter says meanwhile
        self._number = 0

    def update(self, situation: Situation, q_ned_frd: Quaternion) -> None:
        """Begin, go on or end."""
        recorder = self._recorder
        if recorder is None:
            return
        self._take_growth(recorder, situation.now_us)
        wanted_us = self._parts.camera.recording_since_us
        try:
            if self._since_us not in (wanted_us, _NOT_RECORDING):
                self._since_us = _NOT_RECORDING
                recorder.end_film()
            if wanted_us != _NOT_RECORDING:
                self._record(recorder, situation, q_ned_frd)
        except OSError as error:
            self._give_up(situation.now_us, reason_of(error))
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
            self._say(now_us, f"Video {'/'.join(place)}")
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

    def _take_growth(self, recorder: Recorder, now_us: int) -> None:
        """Account for what has been stored; a film for which there is no room ends."""
        growth = recorder.film_growth()
        self._parts.storage.add(growth.size_bytes)
        if growth.reason:
            self._give_up(now_us, growth.reason)
        elif self._since_us != _NOT_RECORDING and not self._parts.has_room:
            self._give_up(now_us, "the storage is full")

    def _give_up(self, now_us: int, reason: str) -> None:
        if self._parts.camera.recording_since_us != _NOT_RECORDING:
            self._say(now_us, f"Video ended: {reason}")
        self._parts.camera.stop_video()
