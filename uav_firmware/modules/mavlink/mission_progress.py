"""MISSION_ITEM_REACHED: sent at each reach and repeated, because it is never acknowledged."""

from typing import Final

from uav_firmware.modules.mavlink.addressing import Outgoing
from uav_firmware.modules.mavlink.dialect import mavlink
from uav_firmware.msg.mission import MissionProgress

REPETITIONS: Final = 3
REPETITION_US: Final = 500_000


class ReachedAnnouncer:
    """Watches the navigator's progress and tells every peer what was reached."""

    def __init__(self) -> None:
        self._reached_count = 0
        self._mission_id = 0
        self._seq = 0
        self._left = 0
        self._due_us = 0

    def tick(self, progress: MissionProgress | None, now_us: int) -> list[Outgoing]:
        """Messages due now; a newer item or another mission ends the repetitions of the former."""
        if progress is None:
            return []
        if progress.reached_count != self._reached_count:
            self._reached_count = progress.reached_count
            self._mission_id = progress.mission_id
            self._seq = progress.seq_reached
            self._left = 1 + REPETITIONS if progress.seq_reached >= 0 else 0
            self._due_us = now_us
        elif progress.mission_id != self._mission_id:
            self._mission_id = progress.mission_id
            self._left = 0
        if self._left == 0 or now_us < self._due_us:
            return []
        self._left -= 1
        self._due_us = now_us + REPETITION_US
        return [Outgoing(mavlink.MAVLink_mission_item_reached_message(seq=self._seq))]
