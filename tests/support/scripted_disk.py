"""The broker's journal on a disk that is as slow as a test wants, in simulated time."""

import shutil
from collections.abc import Callable
from pathlib import Path

from mavlink_broker.recovery.folder import JournalFolder
from mavlink_broker.recovery.progress import Note
from mavlink_broker.recovery.record import NOTHING, Memo, Owner


class ScriptedDisk:
    """Writes what it is left after a while; what is on the way dies with its broker."""

    def __init__(self, folder: Path, clock: Callable[[], float], lag_s: float = 0.0) -> None:
        folder.mkdir(exist_ok=True)
        self._folder = JournalFolder(folder)
        self._clock = clock
        self._lag_s = lag_s
        self._known: dict[Owner, Memo] = {}
        self._on_the_way: list[tuple[float, Note]] = []
        self.refuses = False
        self.is_stuck = False
        self.written = 0
        self.begin()

    def begin(self) -> None:
        """Read what an earlier broker has left."""
        self._on_the_way = []
        self._known = self._folder.read_all()

    def move(self, folder: Path) -> None:
        """Go on in another folder, with a copy of what is here."""
        shutil.copytree(self._folder.path, folder)
        self._folder = JournalFolder(folder)

    def recall(self, owner: Owner) -> Memo:
        """Give what is known of a vehicle."""
        return self._known.get(owner, NOTHING)

    def put(self, note: Note) -> None:
        """Leave a page to be written."""
        self._known[note.owner] = note.memo
        self._on_the_way.append((self._clock() + self._lag_s, note))

    def take_settled(self) -> list[tuple[Owner, int]]:
        """Write what is due; gives what was written or refused."""
        if self.is_stuck:
            return []
        due = [note for at, note in self._on_the_way if at <= self._clock()]
        self._on_the_way = [one for one in self._on_the_way if one[0] > self._clock()]
        for note in due:
            if not self.refuses:
                self._folder.write(note.owner, note.memo)
                self.written += 1
        return [(note.owner, note.number) for note in due]
