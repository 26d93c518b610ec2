"""A humidity sensor that speaks only to fail.

What was never heard cannot fall silent, so it is well some times first. Then it is silent, or
says what no air can have.
"""

import math
from collections.abc import Set as AbstractSet
from typing import Final

from sim.tester.alarms import Alarm

HUMIDITY_PERCENT: Final = 55.0
NO_HUMIDITY: Final = -1.0
SPEAKS_EVERY_S: Final = 0.5
WELL_TIMES: Final = 4


class Hygrometer:
    """Speaks while one of its alarms is set."""

    def __init__(self) -> None:
        self._spoken = 0
        self._speaks_at = -math.inf

    def begin(self, now: float) -> None:
        """Be well again, to fail from now on."""
        self._spoken, self._speaks_at = 0, now

    def measure(self, alarms: AbstractSet[Alarm], now: float) -> float | None:
        """Give a humidity [%] that is to be told now; None for silence."""
        fails = alarms & {Alarm.HUMIDITY_SENSOR, Alarm.HUMIDITY_SENSING}
        if not fails or now < self._speaks_at:
            return None
        self._speaks_at = now + SPEAKS_EVERY_S
        self._spoken += 1
        if self._spoken <= WELL_TIMES:
            return HUMIDITY_PERCENT
        return None if Alarm.HUMIDITY_SENSOR in fails else NO_HUMIDITY
