"""The ages of events by a clock that nobody sets, for when the time of day is set back.

A time of receipt after now is that of a clock which was wrong. The process that has received the
event still knows its age. Behind a restart nobody does: the machine may have been off for days.
"""

from collections.abc import Callable, Collection


class EventAges:
    """When this process has received its events; call it under the lock of the work."""

    def __init__(self, monotonic: Callable[[], float]) -> None:
        """`monotonic` gives a time [s] that no time server changes."""
        self._monotonic = monotonic
        self._received_s: dict[int, float] = {}  # By the id of their work

    def note(self, work_id: int) -> None:
        """Note that an event is received now."""
        self._received_s[work_id] = self._monotonic()

    def age_s(self, work_id: int) -> float | None:
        """Return how long ago an event was received; None if another process has received it."""
        received_s = self._received_s.get(work_id)
        return None if received_s is None else self._monotonic() - received_s

    def keep_only(self, work_ids: Collection[int]) -> None:
        """Forget all events but these."""
        known = self._received_s
        self._received_s = {one: known[one] for one in work_ids if one in known}
