"""When a person whose lines have ended may leave.

Not before the broker has heard how the last mission ended. Lines that are left when no mission
runs wait for the next one, but not for ever once a mission was flown.
"""

from typing import Final

from sim.tester.stand_in import StandIn

LINGER_S: Final = 2.0
NEXT_MISSION_WITHIN_S: Final = 30.0


class Departure:
    """Waits for the moment."""

    def __init__(self) -> None:
        self._since: float | None = None

    def is_due(self, vehicle: StandIn, now: float, *, is_asked: bool, lines_left: bool) -> bool:
        """Judge, after the last line has come; `is_asked` if the menus wait for one."""
        if vehicle.is_landing or (lines_left and (is_asked or not vehicle.mission.items)):
            self._since = None
            return False
        if self._since is None:
            self._since = now
        patience_s = NEXT_MISSION_WITHIN_S if lines_left else LINGER_S
        return now - self._since >= (patience_s if vehicle.mission.items else 0.0)
