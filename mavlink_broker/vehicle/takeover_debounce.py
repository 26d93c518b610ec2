"""For how long a vehicle has done something else than what its mission wants of it."""

from typing import Final

GRACE_S: Final = 5.0
"""How long a departure must last: several periods of every message that could explain it."""
HELD_BY_FAILSAFE: Final = "the vehicle's own failsafe holds it"
FAILSAFE_S: Final = 10.0
"""How long that must last: PX4 holds for 5 s before it does what its failsafe has chosen, and goes
on with its mission when the reason has gone meanwhile."""


class Departure:
    """Believes what lasts."""

    def __init__(self) -> None:
        self._since: float | None = None

    def judge(self, reason: str | None, now: float) -> str | None:
        """Take what speaks for a departure now, None for nothing; gives what is to be believed."""
        if reason is None:
            self._since = None
            return None
        if self._since is None:
            self._since = now
        grace_s = FAILSAFE_S if reason == HELD_BY_FAILSAFE else GRACE_S
        return reason if now - self._since >= grace_s else None
