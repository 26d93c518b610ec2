"""Tells that an axis has left the angles that flight keeps to, for longer than a gust lasts."""


class AxisWatch:
    """One angle, its limit and its time."""

    __slots__ = ("_beyond_s", "exceeded")

    def __init__(self) -> None:
        self.exceeded = False
        self._beyond_s = 0.0

    def update(self, angle: float, limit: float, time_s: float, dt: float) -> bool:
        """Whether |angle| has been beyond `limit` for `time_s`; a limit of 0 is none."""
        if limit > 0.0 and abs(angle) > limit:
            self._beyond_s += dt
        else:
            self._beyond_s = 0.0
        self.exceeded = self._beyond_s >= time_s
        return self.exceeded
