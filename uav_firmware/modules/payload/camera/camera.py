"""Decides when the camera exposes and which orders it refuses. Pure.

The camera needs `EXPOSURE_US` per picture. Up to `WAITING_MAX` single pictures queue. A series that
a mission started pauses while the mission is not flown; single pictures by hand may be taken then.
"""

import math
from dataclasses import dataclass
from typing import Final

from uav_firmware.lib.payload_rules import INTERVAL_MIN_S
from uav_firmware.modules.payload.camera.states import (
    CameraBusyError,
    CameraEvent,
    CameraState,
    after,
)
from uav_firmware.msg.payload import CameraMode, ImageStatus
from uav_firmware.msg.vectors import Vector3

EXPOSURE_US: Final = 200_000
"""[us] From the exposure until the next one is possible."""
WAITING_MAX: Final = 8
DEFAULT_INTERVAL_S: Final = 1.0
"""[s] Interval of a series that does not specify one."""
_ENDLESS: Final = 0


@dataclass(slots=True)
class _Series:
    """Pictures by time or by distance."""

    interval_us: int  # [us] 0 by distance
    distance_m: float  # [m] 0 by time
    left: int  # [-] Pictures still to take; endless when 0
    next_us: int  # [us] When the next one is due
    from_mission: bool
    last_ned: Vector3 | None = None  # [m] Where the last one was taken


class Camera:
    """Shutter, mode and video."""

    def __init__(self) -> None:
        self.state = CameraState.IDLE
        self.mode = CameraMode.IMAGE
        self.recording_since_us = -1
        self.report_interval_us = 0
        self.answers = True  # Whether the device responds
        self.memory_full = False  # The device must store pictures before it can expose
        self._waiting = 0  # Queued pictures
        self._series: _Series | None = None
        self._is_paused = False  # A series of the mission, while that is not flown
        self._ready_us = 0  # When the next exposure is possible
        self._exposing = False

    def take_picture(self, *, limited: bool = True) -> None:
        """Take one picture as soon as possible.

        Args:
            limited: by hand; pictures of the mission are not limited, and wait for its series.

        Raises:
            CameraBusyError: if the camera is busy, or too many pictures are queued.
        """
        if self.state is CameraState.SERIES and not (limited and self._is_paused):
            raise CameraBusyError(f"the camera is busy ({self.state.value})")
        if limited and self._waiting >= WAITING_MAX:
            raise CameraBusyError(f"{self._waiting} pictures are queued")
        self._apply_event(CameraEvent.SHOOT)
        self._waiting += 1

    def begin_series(
        self, interval_s: float, count: int, now_us: int, *, from_mission: bool
    ) -> None:
        """Take `count` pictures (0: until stopped), the first at once.

        Raises:
            CameraBusyError: if the camera is busy.
        """
        self._apply_event(CameraEvent.BEGIN_SERIES)
        unset = math.isnan(interval_s) or interval_s == 0.0
        interval = DEFAULT_INTERVAL_S if unset else max(interval_s, INTERVAL_MIN_S)
        self._series = _Series(round(interval * 1e6), 0.0, count, now_us, from_mission)

    def begin_distance(self, distance_m: float, *, at_once: bool, from_mission: bool) -> None:
        """Take a picture every `distance_m` [m], measured from the first or from here.

        Raises:
            CameraBusyError: if the camera is busy.
        """
        self._apply_event(CameraEvent.BEGIN_DISTANCE)
        self._series = _Series(0, distance_m, _ENDLESS, 0, from_mission)
        if at_once:
            self._waiting += 1

    def begin_panorama(self) -> None:
        """Reserve the camera for `expose_in_panorama`.

        Raises:
            CameraBusyError: if the camera is busy.
        """
        self._apply_event(CameraEvent.BEGIN_PANORAMA)

    def expose_in_panorama(self, now_us: int) -> bool:
        """Expose if the camera is ready; return whether it did."""
        if self.memory_full or now_us < self._ready_us:
            return False
        self._ready_us = now_us + EXPOSURE_US
        return True

    def stop(self) -> None:
        """Stop taking pictures."""
        self._waiting = 0
        self._series, self._is_paused = None, False
        if self.state is not CameraState.IDLE:
            self._apply_event(CameraEvent.STOP)

    def stop_series(self) -> bool:
        """Stop a series by time or distance; return whether there was one."""
        if self._series is None:
            return False
        self.stop()
        return True

    @property
    def ends_by_itself(self) -> bool:
        """Whether the camera becomes idle without an order."""
        endless = self._series is not None and self._series.left == _ENDLESS
        return self.state is not CameraState.IDLE and not endless

    def update(self, now_us: int, position_ned: Vector3 | None, *, mission_flown: bool) -> bool:
        """Return whether a picture is exposed now; the caller then takes it.

        Args:
            now_us: [us].
            position_ned: [m] None while unknown; distances are then not measured.
            mission_flown: whether a series of the mission continues.
        """
        self._exposing = now_us < self._ready_us
        series = self._series
        self._is_paused = series is not None and series.from_mission and not mission_flown
        if (
            self.memory_full
            or self._exposing
            or self.state is CameraState.IDLE
            or self.state is CameraState.PANORAMA
        ):
            return False
        if self._waiting:
            self._waiting -= 1
            if series is not None:
                series.last_ned = position_ned
        elif series is None:
            self._apply_event(CameraEvent.SAVED)
            return False
        elif self._is_paused:
            series.next_us = max(series.next_us, now_us)
            return False
        elif not self._due(series, now_us, position_ned):
            return False
        self._ready_us = now_us + EXPOSURE_US
        self._exposing = True
        return True

    def _due(self, series: _Series, now_us: int, position_ned: Vector3 | None) -> bool:
        """Whether a picture of the series is due now; if so, count it."""
        if series.distance_m > 0.0:
            return _far_enough(series, position_ned)
        if now_us < series.next_us:
            return False
        series.next_us += series.interval_us
        if series.left == 1:
            self.stop()
        elif series.left > 1:
            series.left -= 1
        return True

    @property
    def image_status(self) -> ImageStatus:
        """Status for CAMERA_CAPTURE_STATUS; pictures by distance count as a series."""
        if self._series is not None:
            exposing = self._exposing
            return ImageStatus.SERIES_CAPTURING if exposing else ImageStatus.SERIES_WAITING
        return ImageStatus.IDLE if self.state is CameraState.IDLE else ImageStatus.CAPTURING

    @property
    def interval_s(self) -> float:
        """Time between the pictures of a series [s]; 0 when there is none."""
        return self._series.interval_us * 1e-6 if self._series is not None else 0.0

    def start_video(self, rate_hz: float, now_us: int) -> None:
        """Start to record, and report the status `rate_hz` times a second.

        Raises:
            CameraBusyError: if it is recording.
        """
        if self.recording_since_us >= 0:
            raise CameraBusyError("the camera is already recording")
        self.recording_since_us = now_us
        self.report_interval_us = round(1e6 / rate_hz) if rate_hz > 0.0 else 0

    def stop_video(self) -> None:
        """Stop recording."""
        self.recording_since_us, self.report_interval_us = -1, 0

    def _apply_event(self, event: CameraEvent) -> None:
        self.state = after(self.state, event)


def _far_enough(series: _Series, position_ned: Vector3 | None) -> bool:
    if position_ned is None:
        return False
    if series.last_ned is None:
        series.last_ned = position_ned
        return False
    flown = math.dist(series.last_ned, position_ned)
    if flown < series.distance_m:
        return False
    # The excess distance counts for the next picture, so that errors do not add up
    share = series.distance_m / flown if flown < 2.0 * series.distance_m else 1.0
    last = [a + share * (b - a) for a, b in zip(series.last_ned, position_ned, strict=True)]
    series.last_ned = (last[0], last[1], last[2])
    return True
