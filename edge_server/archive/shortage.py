"""How much of a short disk flights have to make free, and when; pure.

A disk that is short for a moment costs no flight, and neither does one that the whole archive could
not help. Undelivered records come first: what they lack now is made free at once.
"""

from typing import Final, NamedTuple

PATIENCE_S: Final = 60.0


class Room(NamedTuple):
    """Room on the disk of the archive [bytes]."""

    free: int
    limit: int
    """The archive leaves this much free."""
    lacking: int = 0
    """How much has to be free so that records are stored again; 0 while they are."""

    @property
    def is_short(self) -> bool:
        """Whether nothing may be archived."""
        return self.free < self.limit


def wanted_bytes(room: Room, short_for_s: float) -> int:
    """Return how much has to be free; 0 while no flight has to go for it.

    `short_for_s` is how long the disk has been short.
    """
    wanted = room.limit if short_for_s >= PATIENCE_S else min(room.lacking, room.limit)
    return wanted if room.free < wanted else 0


def can_help(room: Room, droppable_bytes: int, wanted: int) -> bool:
    """Whether so much becomes free if all is dropped that may be."""
    return room.free + droppable_bytes >= wanted
