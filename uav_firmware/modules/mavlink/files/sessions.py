"""Open files of one client, by session number.

A file gets the number that its client has put into the request: MAVProxy hears answers under no
other, and MAVSDK asks for 0 and goes on with 0 whatever the answer says. So a number that is taken
is refused, as PX4 refuses a second file, until the file has not been wanted for a while: then its
client has forgotten it. Each client has its own space of numbers.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from uav_firmware.cal.files import OpenFile, OpenMode, Place
from uav_firmware.modules.mavlink.files.codec import Fault, FileError

MAX_SESSIONS: Final = 8
"""For each client."""
IDLE_LIMIT_US: Final = 60_000_000
"""A file of which nothing is wanted for so long is closed."""
TAKE_OVER_US: Final = 3_000_000
"""A file of which nothing was wanted for so long gives its number to a new one."""
RECLAIM_US: Final = 10_000_000
"""A file of which nothing was wanted for so long gives way when too many are open."""
MAX_REPETITIONS: Final = 10
"""So often a client repeats a request for lack of an answer."""


@dataclass(slots=True)
class Burst:
    """A stretch of a file that is being sent."""

    offset: int
    packets: int  # How many are still to be sent
    size: int  # [bytes] Of each
    seq: int  # Of the next packet


@dataclass(slots=True)
class Session:
    """One open file."""

    number: int
    file: OpenFile
    place: Place
    mode: OpenMode
    touched_us: int
    used: bool = False  # Whether it has been read or written
    repetitions: int = 0  # Of its opening, under other sequence numbers
    burst: Burst | None = None


class SessionTable:
    """The sessions of one client."""

    def __init__(self) -> None:
        self._sessions: dict[int, Session] = {}

    def __iter__(self) -> Iterator[Session]:
        return iter(list(self._sessions.values()))

    def __len__(self) -> int:
        return len(self._sessions)

    def fresh(self, place: Place, mode: OpenMode, number: int) -> Session | None:
        """The session of a number, if this opens the same file again before it was used.

        Clients that give a repeated request a new sequence number would be refused otherwise.
        """
        session = self._sessions.get(number)
        if session is None or session.used or session.repetitions >= MAX_REPETITIONS:
            return None
        if (session.place, session.mode) != (place, mode):
            return None
        session.repetitions += 1
        return session

    def make_free(self, number: int, now_us: int) -> None:
        """Make sure that a number can be given to a new session.

        Raises:
            FileError: if it is in use, or as many files are open as may be.
        """
        holder = self._sessions.get(number)
        if holder is not None:
            if now_us - holder.touched_us < TAKE_OVER_US:
                raise FileError(Fault.NO_SESSIONS_AVAILABLE)
            self._drop(holder)
        if len(self._sessions) >= MAX_SESSIONS:
            self.close_idle(now_us - RECLAIM_US)
        if len(self._sessions) >= MAX_SESSIONS:
            raise FileError(Fault.NO_SESSIONS_AVAILABLE)

    def add(self, session: Session) -> None:
        """Keep a new session."""
        self._sessions[session.number] = session

    def get(self, number: int, now_us: int) -> Session:
        """The session of a number, which something is wanted of now.

        Raises:
            FileError: if there is none.
        """
        session = self._sessions.get(number)
        if session is None:
            raise FileError(Fault.INVALID_SESSION)
        session.touched_us = now_us
        return session

    def close(self, number: int, now_us: int) -> None:
        """End a session.

        Raises:
            FileError: if there is none.
            OSError: if what was written cannot be used.
        """
        session = self.get(number, now_us)
        del self._sessions[number]
        session.file.close()

    def close_idle(self, since_us: int) -> None:
        """Drop the sessions of which nothing has been wanted since."""
        for session in self:
            if session.touched_us <= since_us:
                self._drop(session)

    def close_all(self) -> None:
        """End every session; some clients end an upload in this way.

        A store that refuses what was written says so itself: a reset is always acknowledged.
        """
        for session in self:
            del self._sessions[session.number]
            with suppress(OSError):
                session.file.close()

    def abandon_all(self) -> None:
        """Drop every session."""
        for session in self:
            self._drop(session)

    def _drop(self, session: Session) -> None:
        del self._sessions[session.number]
        session.file.abandon()
