"""Logs changes: arming, mode, landed state, mission, status texts."""

from collections.abc import Callable
from typing import TypeVar

from uav_firmware.bus import Queue, Topic
from uav_firmware.msg.mission import MissionProgress
from uav_firmware.msg.status import LandDetected, StatusText, VehicleStatus

T = TypeVar("T")


class ConsoleModule:
    """Writes a line for each change; `write` adds the vehicle id to time [us] and text."""

    def __init__(
        self,
        write: Callable[[int, str], None],
        *,
        status_text: Queue[StatusText],
        vehicle_status: Topic[VehicleStatus],
        land_detected: Topic[LandDetected],
        mission_progress: Topic[MissionProgress],
        time_us: Callable[[], int],
    ) -> None:
        self._write = write
        self._status_text = status_text
        self._vehicle_status = vehicle_status
        self._land_detected = land_detected
        self._mission_progress = mission_progress
        self._time_us = time_us
        self._status: VehicleStatus | None = None
        self._land: LandDetected | None = None
        self._progress: MissionProgress | None = None

    def update(self) -> None:
        """Write what has changed since the last call."""
        now_us = self._time_us()
        for text in self._status_text.drain():
            self._write(text.time_us, text.text)
        for line in (*self._status_lines(), *self._land_lines(), *self._mission_lines()):
            self._write(now_us, line)

    def _status_lines(self) -> list[str]:
        previous, now = self._status, self._vehicle_status.value
        self._status = now
        if now is None:
            return []
        lines = []
        if previous is not None and previous.armed is not now.armed:
            lines.append("armed" if now.armed else "disarmed")
        if previous is None or previous.navigation_state is not now.navigation_state:
            lines.append(f"mode {now.navigation_state.name}")
        if now.preflight_checks_pass and (previous is None or not previous.preflight_checks_pass):
            lines.append("ready to arm")
        if now.failsafe and (previous is None or not previous.failsafe):
            lines.append("a failsafe flies the vehicle")
        return lines

    def _land_lines(self) -> list[str]:
        previous, now = self._land, self._land_detected.value
        self._land = now
        if now is None or previous is None or previous.landed_state is now.landed_state:
            return []
        return [f"landed state {now.landed_state.name}"]

    def _mission_lines(self) -> list[str]:
        previous, now = self._progress, self._mission_progress.value
        self._progress = now
        if now is None:
            return []
        lines = []
        if previous is None or previous.mission_id != now.mission_id:
            lines.append(f"mission of {now.seq_total} items")
        if previous is not None and previous.reached_count != now.reached_count:
            lines.append(f"mission item {now.seq_reached} reached")
        return lines
