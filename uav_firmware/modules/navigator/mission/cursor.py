"""Current item of the mission, items reached, and repetitions of jumps.

NO_MISSION --load--> NOT_STARTED --begin--> ACTIVE <--begin/pause--> PAUSED
ACTIVE --past the last item--> COMPLETE --reset--> NOT_STARTED
COMPLETE --set_current--> PAUSED
"""

from collections import deque
from typing import Final

from uav_firmware.msg.mission import (
    Mission,
    MissionCommand,
    MissionItem,
    MissionProgress,
    MissionState,
)

_REACHED_KEPT: Final = 8  # More than can be reached between two messages


class MissionCursor:
    """Current item and progress of a mission."""

    def __init__(self) -> None:
        self.items: tuple[MissionItem, ...] = ()
        self.mission_id = 0
        self._time_us = 0  # Of the mission's acceptance
        self._selections = 0
        self._latest: deque[int] = deque(maxlen=_REACHED_KEPT)
        self.seq = 0
        self.reached = -1
        self.reached_count = 0
        self.begun = False
        self.complete = False
        self._jumps_taken: dict[int, int] = {}

    @property
    def item(self) -> MissionItem | None:
        """Item being flown or next to fly; None when there is none left."""
        if self.complete or self.seq >= len(self.items):
            return None
        return self.items[self.seq]

    def load(self, mission: Mission) -> None:
        """Replace the mission and begin at its first item."""
        self.items, self.mission_id = mission.items, mission.mission_id
        self._time_us = mission.time_us
        self.rewind(0)

    def rewind(self, seq: int) -> None:
        """Begin at an item, with progress and jumps reset."""
        self.reached, self.begun, self.complete = -1, False, False
        self._jumps_taken.clear()
        self.seq = self._take_jumps(seq)

    def select(self, seq: int, *, reset: bool) -> None:
        """DO_SET_MISSION_CURRENT: fly `seq` next (-1: as before).

        A named item ends completion; a reset does so without an item, and resets the
        repetitions of all jumps.
        """
        self._selections += 1
        target = self.seq if seq < 0 else self._resolved(seq)
        if reset:
            self.rewind(target)
        elif seq >= 0:
            self.complete, self.seq = False, target

    def reach(self) -> None:
        """Count the current item as reached."""
        self.reached = self.seq
        self.reached_count += 1
        self._latest.append(self.seq)

    def advance(self) -> None:
        """Go on to the next item; past the last one the mission is complete."""
        following = self._take_jumps(self.seq + 1)
        if following >= len(self.items):
            self.complete = True
        else:
            self.seq = following

    def progress(self, now_us: int, *, active: bool) -> MissionProgress:
        """Progress of the mission, to be published."""
        return MissionProgress(
            now_us,
            self.mission_id,
            self.seq,
            len(self.items),
            self.reached,
            self.reached_count,
            self._state(active=active),
            self._time_us,
            self._selections,
            tuple(self._latest),
        )

    def _state(self, *, active: bool) -> MissionState:
        if not self.items:
            return MissionState.NO_MISSION
        if self.complete:
            return MissionState.COMPLETE
        if active:
            return MissionState.ACTIVE
        return MissionState.PAUSED if self.begun else MissionState.NOT_STARTED

    def _resolved(self, seq: int) -> int:
        """Item that follows from a selected jump, whatever is left of its repetitions.

        Jumps that lead only to each other end the mission.
        """
        for _ in range(len(self.items)):
            if seq >= len(self.items) or self.items[seq].command != MissionCommand.DO_JUMP:
                return seq
            seq = int(self.items[seq].param1)
        return len(self.items)

    def item_after_jumps(self, seq: int) -> int:
        """Item that would be flown if `seq` came next; past the end when there is none."""
        return self._follow_jumps(seq, dict(self._jumps_taken))

    def _take_jumps(self, seq: int) -> int:
        """As `item_after_jumps`, and count the jumps as taken."""
        return self._follow_jumps(seq, self._jumps_taken)

    def _follow_jumps(self, seq: int, jumps_taken: dict[int, int]) -> int:
        for _ in range(len(self.items) + 1):
            if seq >= len(self.items) or self.items[seq].command != MissionCommand.DO_JUMP:
                return seq
            jump = self.items[seq]
            taken = jumps_taken.get(seq, 0)
            if jump.param2 < 0 or taken < jump.param2:
                jumps_taken[seq] = taken + 1
                seq = int(jump.param1)
            else:
                seq += 1
        return len(self.items)
