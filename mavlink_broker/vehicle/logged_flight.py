"""A flight of one vehicle, which of its logs are of it, and which are incomplete. Pure.

Autopilots state one time of a log: the project's vehicle that of its beginning, PX4 and ArduPilot
that of its last change. Which log is of a flight follows from the times of all logs, by the
vehicle's clock, which the broker knows from SYSTEM_TIME.
"""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Final, NamedTuple

from mavlink_broker.effects import BeginLog, LogJobFailed, LogJobOutcome
from mavlink_broker.microservices.log_download import LogEntry

EDGE_S: Final = 5.0
"""Arming and disarming are noticed so late at most."""
FIND_AGAIN_S: Final = 60.0
"""A log that a killed broker has begun may be listed late, one that was dropped may stay."""
FIND_EVERY_S: Final = 600.0
AWAY_PAUSE_S: Final = 30.0
DROPPED_KEPT: Final = 64
MAX_FLIGHTS: Final = 8
"""Flights of a vehicle that wait; beyond that the oldest is forgotten."""
MAX_FAILURES: Final = 5
_FIRST_PAUSE_S: Final = 30.0
LONGEST_PAUSE_S: Final = 600.0
MAX_LOGS: Final = 4
"""Logs of one flight: a vehicle begins another one when a log becomes too large."""


def pause_after_s(failures: int) -> float:
    """How long a flight waits after so many failures [s], which the next attempt may add to."""
    return min(_FIRST_PAUSE_S * 2.0**failures, LONGEST_PAUSE_S)


class FlownSpan(NamedTuple):
    """A flight by its vehicle's clock [s since 1970], and when the vehicle was switched on."""

    armed_s: float
    disarmed_s: float
    booted_s: float


@dataclass(slots=True)
class LoggedFlight:
    """One flight, and the log of it as far as it is known."""

    name: str
    started_at: datetime
    ended_at: datetime
    span: FlownSpan | None
    armed_at: float  # By the broker's monotonic clock
    not_before: float
    begun: BeginLog | None = None  # As the edge server knows it
    entry: LogEntry | None = None  # As it was listed last
    lists: int = 0
    failures: int = 0
    fetching_s: float = 0.0


def logs_of(span: FlownSpan, entries: Iterable[LogEntry], *, has_end_times: bool) -> list[LogEntry]:
    """Choose the logs of a flight, newest first.

    A log is listed with the time of its beginning, and lasts until the next one begins; or with the
    time of its end (`has_end_times`). None is older than the vehicle's last start. Flights may
    follow each other within a second, and arming is noticed late, so that a log that touches only
    the edge of a flight is not of that flight.
    """
    margin_s = min(EDGE_S, (span.disarmed_s - span.armed_s) / 4.0)
    first_s, last_s = span.armed_s + margin_s, span.disarmed_s - margin_s
    timed = sorted(entries, key=lambda entry: (entry.time_s, entry.number))
    limits = [-math.inf, *(entry.time_s for entry in timed), math.inf]
    found = []
    for index, entry in enumerate(timed):
        begins, ends = limits[index : index + 2] if has_end_times else limits[index + 1 : index + 3]
        is_since_start = has_end_times or begins >= span.booted_s - EDGE_S
        if is_since_start and begins <= last_s and ends >= first_s:
            found.append(entry)
    return found[::-1][:MAX_LOGS]


def with_number(
    known: LogEntry, entries: Iterable[LogEntry], found: Iterable[LogEntry]
) -> list[LogEntry]:
    """Choose the log with a known number instead of that with its time, and those before it.

    ArduPilot lists an open log with the present time, so that its time changes when it is closed.
    """
    same = [one for one in entries if one.number == known.number and one.size >= known.size]
    return same + [entry for entry in found if entry.number < known.number]


class IncompleteLogs:
    """The logs of one vehicle that the edge server has in part: when it is asked, what follows.

    What an earlier run of the broker has begun goes on; what this run has given up is deleted.
    """

    def __init__(self) -> None:
        self.are_known = False  # Those of an earlier run
        self._is_asking = False
        self._due_at = 0.0
        self._dropped: deque[str] = deque(maxlen=DROPPED_KEPT)

    def is_due(self, now: float) -> bool:
        """Whether the edge server is to be asked."""
        return now >= self._due_at

    def ask(self) -> None:
        """Note that it is asked."""
        self._is_asking = True

    def end_question(self) -> bool:
        """Whether it was asked, and this is the answer."""
        was_asking, self._is_asking = self._is_asking, False
        return was_asking

    def drop(self, name: str) -> None:
        """Note that a log was given up."""
        self._dropped.append(name)

    def take(self, outcome: LogJobOutcome, now: float) -> tuple[list[str], list[BeginLog]]:
        """Read the answer; gives the names to delete again, and what an earlier run has begun."""
        if isinstance(outcome, LogJobFailed):
            self.are_known |= not outcome.is_temporary
            self._due_at = now + (AWAY_PAUSE_S if outcome.is_temporary else FIND_EVERY_S)
            return [], []
        self._due_at = now + (FIND_EVERY_S if self.are_known else FIND_AGAIN_S)
        self.are_known = True
        logs = [
            state.log
            for state in outcome.logs
            if not state.is_complete and state.log.format != "tlog"  # That is the broker's own
        ]
        dropped = [log.name for log in logs if log.name in self._dropped]
        return dropped, [log for log in logs if log.name not in dropped]
