"""One reader's stream as server-sent events (HTML Standard, section 9.2)."""

from collections.abc import Callable
from typing import Final

from edge_server.live.changes import Change, Changes

HEARTBEAT_S: Final = 4.0
"""The console is offline after 10 s of silence (`console/src/live/feed.ts`)."""
_HEARTBEAT: Final = b":\n\n"


class LiveStream:
    """What one reader still has to receive; called by one thread."""

    def __init__(
        self,
        changes: Changes,
        state: Callable[[frozenset[int] | None], str],
        *,
        vehicle_ids: frozenset[int] | None,
        last_id: str,
        is_admitted: Callable[[], bool],
        note_reader: Callable[[], None],
    ) -> None:
        """Begin behind `last_id`, or with the complete state if that is not possible.

        `vehicle_ids` restricts it to these vehicles. `is_admitted` is false once the reader's key
        or session has ended; it never blocks.
        """
        self._changes = changes
        self._state = state
        self._vehicle_ids = vehicle_ids
        self._sent = changes.number_of(last_id)
        self._is_admitted = is_admitted
        self._note_reader = note_reader
        self._heartbeat_at = float("-inf")

    def take(self, now: float) -> bytes | None:
        """Give what is new, with a heartbeat in time; None ends the stream. `now` is monotonic."""
        if not self._is_admitted():
            return None
        self._note_reader()
        is_due = now >= self._heartbeat_at
        if self._sent == self._changes.last and not is_due:
            return b""
        if is_due:
            self._heartbeat_at = now + HEARTBEAT_S
        new = self._new()
        return new or (_HEARTBEAT if is_due else b"")

    def _new(self) -> bytes:
        last = self._changes.last  # Before the state is read: a change may come twice, never not
        found = None if self._sent is None else self._changes.after(self._sent)
        if found is None:
            self._sent = last
            return self._changes.encode("snapshot", last, self._state(self._vehicle_ids))
        if found:
            self._sent = found[-1].number
        return b"".join(change.event for change in found if self._permits(change))

    def _permits(self, change: Change) -> bool:
        known = self._vehicle_ids
        return known is None or change.vehicle_id is None or change.vehicle_id in known
