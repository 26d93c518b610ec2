"""Brings pages onto the disk on a thread, so that the loop never waits for it.

Of each vehicle the newest page alone is written. A disk that refuses is told of once, and tried
again every five seconds.
"""

import logging
import threading
from collections.abc import Callable
from typing import Final

from mavlink_broker.internal_errors import reason_of
from mavlink_broker.recovery.encoding import PageError
from mavlink_broker.recovery.folder import JournalFolder
from mavlink_broker.recovery.progress import Note
from mavlink_broker.recovery.record import NOTHING, Memo, Owner
from mavlink_broker.supervision import SupervisedThread

TRY_AGAIN_S: Final = 5.0
END_WITHIN_S: Final = 5.0
"""How long an ending program waits for a slow disk."""

_LOG = logging.getLogger(__name__)


class JournalWriter:
    """The pages of one broker, read once, and a thread that writes them."""

    def __init__(self, folder: JournalFolder, wake: Callable[[], None]) -> None:
        """Read what an earlier run has left; `wake` ends the loop's sleep."""
        self._folder = folder
        self._wake = wake
        self._known: dict[Owner, Memo] = folder.read_all()
        self._changed = threading.Condition()
        self._due: dict[Owner, Note] = {}
        self._refused: dict[Owner, Note] = {}
        self._settled: list[tuple[Owner, int]] = []
        self._is_ending = False
        self._is_told = False  # That the disk refuses
        self._stopping = threading.Event()
        self._thread = SupervisedThread("journal", self._run, self._stopping)
        self._thread.start()

    def recall(self, owner: Owner) -> Memo:
        """Give what is known of a vehicle."""
        return self._known.get(owner, NOTHING)

    def put(self, note: Note) -> None:
        """Leave a page to be written; never waits for the disk."""
        self._known[note.owner] = note.memo
        with self._changed:
            self._due[note.owner] = note
            self._changed.notify()

    def take_settled(self) -> list[tuple[Owner, int]]:
        """Give the numbers of the pages that were written or refused since."""
        if not self._settled:
            return []
        with self._changed:
            settled, self._settled = self._settled, []
        return settled

    def close(self) -> None:
        """Write what waits, if the disk takes it, and end."""
        with self._changed:
            self._is_ending = True
            self._stopping.set()
            self._changed.notify()
        self._thread.join(END_WITHIN_S)

    def _run(self) -> None:
        while True:
            with self._changed:
                waits_s = TRY_AGAIN_S if self._refused else None
                self._changed.wait_for(lambda: self._due or self._is_ending, waits_s)
                due, self._due = {**self._refused, **self._due}, {}
                is_ending = self._is_ending
            for note in due.values():
                self._write(note)
            if is_ending and not self._due:
                return

    def _write(self, note: Note) -> None:
        try:
            self._folder.write(note.owner, note.memo)
        except OSError as error:
            self._refuse(note, error.strerror or str(error))
        except PageError as error:
            self._refuse(note, str(error))
        except Exception as error:  # noqa: BLE001  # the boundary of one page, logged
            _LOG.exception("the page of %s", note.owner)
            self._refuse(note, reason_of(error))
        else:
            self._refused.pop(note.owner, None)
            if self._is_told and not self._refused:
                self._is_told = False
                _LOG.warning("%s takes the broker's journal again", self._folder.path)
        with self._changed:
            self._settled.append((note.owner, note.number))
        self._wake()

    def _refuse(self, note: Note, reason: str) -> None:
        self._refused[note.owner] = note
        if not self._is_told:
            self._is_told = True
            _LOG.warning(
                "no journal is kept in %s: %s; a broker that is killed now forgets what it has "
                "borrowed of its vehicles",
                self._folder.path,
                reason,
            )
