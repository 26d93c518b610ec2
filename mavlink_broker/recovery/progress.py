"""Whether what must outlive the broker is on the disk yet; pure.

What changes a vehicle waits for its note; so do the words to the edge server that follow from it.
A disk that refuses is waited for no longer than it takes to refuse, one that does not answer for
two seconds: no flight ends for it.
"""

import logging
from dataclasses import dataclass
from typing import Final

from mavlink_broker.recovery.record import NOTHING, Memo, Owner

PATIENCE_S: Final = 2.0

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Note:
    """A page to be written; empty, to be removed."""

    owner: Owner
    number: int
    memo: Memo


class Diary:
    """The pages of one vehicle. One that is not used keeps nothing and delays nothing."""

    def __init__(self, *, in_use: bool = False) -> None:
        self._in_use = in_use
        self._noted = NOTHING
        self._number = 0
        self._settled = 0  # The newest page that is on the disk, or was refused
        self._waits_since: float | None = None
        self._is_slow = False  # The disk owes an answer
        self.owner: Owner | None = None  # None: who the vehicle is is not known yet

    @property
    def in_use(self) -> bool:
        """Whether there is a disk to write to."""
        return self._in_use

    @property
    def is_open(self) -> bool:
        """Whether what an earlier run has noted is known by now."""
        return not self._in_use or self.owner is not None

    def open(self, owner: Owner, memo: Memo) -> None:
        """Learn whose it is, and what stands in it."""
        self.owner = owner
        self._noted = memo
        self._settled = self._number
        self._waits_since = None

    def see(self, memo: Memo, now: float) -> Note | None:
        """Take what there is to be known; gives the page where that is news."""
        if self.owner is None:
            return None
        self._lose_patience(now)
        if memo == self._noted:
            return None
        self._number += 1
        self._noted = memo
        if self._waits_since is None:
            self._waits_since = now
        return Note(self.owner, self._number, memo)

    def settle(self, number: int) -> None:
        """Take that a page is on the disk, or that the disk has refused it."""
        self._is_slow = False
        self._settled = max(self._settled, min(number, self._number))
        if self._settled == self._number:
            self._waits_since = None

    @property
    def is_settled(self) -> bool:
        """Whether nothing is waited for."""
        return not self._in_use or self._is_slow or self._settled == self._number

    def is_kept(self, memo: Memo) -> bool:
        """Whether this is what is on the disk, as far as the disk takes it."""
        if not self._in_use:
            return True
        return self.owner is not None and self.is_settled and memo == self._noted

    def _lose_patience(self, now: float) -> None:
        if self._is_slow or self._waits_since is None or now - self._waits_since < PATIENCE_S:
            return
        self._is_slow = True
        _LOG.warning("%s: the disk does not take its page: nobody waits for it", self.owner)
