"""Open files of one client, by session number.

A file gets the number that its client has put into the request: MAVProxy hears answers under no
other, as ArduPilot gives it. Most clients put 0 and read the number from the answer, so one that
is taken makes way to the lowest free one. Each client has its own space.
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
RECLAIM_US: Final = 10_000_000
"""A file of which nothing was wanted for so long gives way to a new one."""


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
    burst: Burst | None = None


class SessionTable:
    """The sessions of one client."""

    def __init__(self) -> None:
        self._sessions: dict[int, Session] = {}

    def __iter__(self) -> Iterator[Session]:
        return iter(list(self._sessions.values()))

    def __len__(self) -> int:
        return len(self._sessions)

    def fresh(self, place: Place, mode: OpenMode, wanted: int) -> Session | None:
        """A session on a file that was opened the same way and not used yet.

        Clients that number a repetition anew would hold one more session with each.
        """
        taken = wanted in self._sessions
        for session in self._sessions.values():
            same = session.place == place and session.mode is mode and not session.used
            if same and (taken or session.number == wanted):
                return session
        return None

    def free_number(self, wanted: int, now_us: int) -> int:
        """The number that the next session gets: the wanted one if it is free.

        Raises:
            FileError: if as many files are open as may be.
        """
        if len(self._sessions) >= MAX_SESSIONS:
            self.close_idle(now_us - RECLAIM_US)
        if len(self._sessions) >= MAX_SESSIONS:
            raise FileError(Fault.NO_SESSIONS_AVAILABLE)
        if wanted not in self._sessions:
            return wanted
        return next(number for number in range(MAX_SESSIONS) if number not in self._sessions)

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
