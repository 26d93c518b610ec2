"""MISSION_ITEM_REACHED: sent at each reach and repeated, because it is never acknowledged."""

from typing import Final

from uav_firmware.modules.mavlink.wire.addressing import Outgoing
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.mission import MissionProgress

REPETITIONS: Final = 3
REPETITION_US: Final = 500_000


class ReachedAnnouncer:
    """Watches the navigator's progress and tells every peer what was reached."""

    def __init__(self) -> None:
        self._reached_count = 0
        self._mission = (0, 0)  # Id and time of acceptance
        self._seq = 0
        self._left = 0
        self._due_us = 0

    def tick(self, progress: MissionProgress | None, now_us: int) -> list[Outgoing]:
        """Messages due now; a newer item or another mission ends the repetitions of the former."""
        if progress is None:
            return []
        mission = (progress.mission_id, progress.mission_time_us)
        if progress.reached_count != self._reached_count:
            new = progress.latest_reached[self._reached_count - progress.reached_count :]
            self._reached_count, self._mission = progress.reached_count, mission
            self._left, self._due_us = REPETITIONS, now_us + REPETITION_US
            self._seq = progress.seq_reached
            return [_announcement(seq) for seq in new]
        if mission != self._mission:
            self._mission, self._left = mission, 0
        if self._left == 0 or now_us < self._due_us:
            return []
        self._left -= 1
        self._due_us = now_us + REPETITION_US
        return [_announcement(self._seq)]


def _announcement(seq: int) -> Outgoing:
    return Outgoing(mavlink.MAVLink_mission_item_reached_message(seq=seq))
