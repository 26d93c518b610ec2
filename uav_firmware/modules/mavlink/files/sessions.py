"""Open files of one client, by session number.

A session has the number in the client's request: MAVProxy accepts answers with no other number, and
MAVSDK requests 0 and continues with 0 whatever the answer contains. A number in use is refused, as
PX4 refuses a second file, until its file has been idle for `TAKE_OVER_US`. Each client has its own
numbers.
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
"""A file is closed after this time without a request."""
TAKE_OVER_US: Final = 3_000_000
"""The number of a file may be reused after this time without a request."""
RECLAIM_US: Final = 10_000_000
"""When too many files are open, those without a request for this time are closed."""
MAX_REPETITIONS: Final = 10
"""Retries of a client without an answer."""


@dataclass(slots=True)
class Burst:
    """A burst in progress."""

    offset: int
    packets: int  # Still to send
    size: int  # [bytes] Of each packet
    seq: int  # Sequence number of the next packet


@dataclass(slots=True)
class Session:
    """One open file."""

    number: int
    file: OpenFile
    place: Place
    mode: OpenMode
    touched_us: int
    used: bool = False  # Whether it has been read or written
    repetitions: int = 0  # Repeated requests to open it
    burst: Burst | None = None


class SessionTable:
    """The sessions of one client."""

    def __init__(self) -> None:
        self._sessions: dict[int, Session] = {}

    def __iter__(self) -> Iterator[Session]:
        return iter(list(self._sessions.values()))

    def __len__(self) -> int:
        return len(self._sessions)

    def reopened(self, place: Place, mode: OpenMode, number: int) -> Session | None:
        """The session of a number if the request repeats its opening before any use.

        Some clients repeat a request with a new sequence number.
        """
        session = self._sessions.get(number)
        if session is None or session.used or session.repetitions >= MAX_REPETITIONS:
            return None
        if (session.place, session.mode) != (place, mode):
            return None
        session.repetitions += 1
        return session

    def make_free(self, number: int, now_us: int) -> None:
        """Make a number available for a new session.

        Raises:
            FileError: if it is in use, or too many files are open.
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
        """Add a new session."""
        self._sessions[session.number] = session

    def get(self, number: int, now_us: int) -> Session:
        """The session of a number; its idle time restarts.

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
            OSError: if the written contents are refused.
        """
        session = self.get(number, now_us)
        del self._sessions[number]
        session.file.close()

    def close_idle(self, since_us: int) -> None:
        """Drop the sessions without a request since a time [us]."""
        for session in self:
            if session.touched_us <= since_us:
                self._drop(session)

    def close_all(self) -> None:
        """Close every session; some clients end an upload this way.

        A reset is always acknowledged; a store reports refused contents itself.
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
