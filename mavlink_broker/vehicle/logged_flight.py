"""A flight of one vehicle, which of its logs are of it, and which are incomplete. Pure.

Autopilots state one time of a log: the project's vehicle that of its beginning, PX4 and ArduPilot
that of its last change. Which log is of a flight follows from the times of all logs, by the
vehicle's clock, which the broker knows from SYSTEM_TIME. That clock may go back when the vehicle is
restarted, so that a log of an earlier start may have a time within a later flight; then what the
broker knows of the log from before decides.
"""

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final, NamedTuple

from mavlink_broker.effects import BeginLog, LogJobFailed, LogJobOutcome
from mavlink_broker.microservices.log_download import LogEntry
from mavlink_broker.vehicle.vehicle import Vehicle

EDGE_S: Final = 5.0
"""Longest delay at which arming and disarming are noticed."""
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
LISTED_KEPT: Final = 1024
SENT_KEPT: Final = 64
"""Logs of a vehicle that are remembered."""
MAX_LOGS: Final = 4
"""Logs of one flight: a vehicle begins another one when a log becomes too large."""


def pause_after_s(failures: int) -> float:
    """How long a flight waits after so many failures [s], which the next attempt may add to."""
    return min(_FIRST_PAUSE_S * 2.0**failures, LONGEST_PAUSE_S)


def flown_unseen_s(vehicle: Vehicle) -> float:
    """How long a flight has lasted by the vehicle's clock [s], of which this run saw no beginning.

    0 if it has seen that, or if no earlier run has noted it.
    """
    armed_s, now_s = vehicle.recovery.armed_s, vehicle.snapshot.time_s
    if not vehicle.armed_period.is_found or armed_s is None or now_s is None:
        return 0.0
    return max(0.0, now_s - armed_s)


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
    boot: int | None = None  # Restarts of the vehicle before it; None: of an earlier run
    begun: BeginLog | None = None  # As the edge server knows it
    entry: LogEntry | None = None  # As it was listed last
    lists: int = 0
    failures: int = 0
    fetching_s: float = 0.0

    def log(self, entry: LogEntry, form: str) -> BeginLog:
        """Describe the log of this flight for the edge server; `form`: its format."""
        return BeginLog(
            name=self.name,
            format=form,
            started_at=self.started_at,
            ended_at=self.ended_at,
            listed_s=entry.time_s,
            size_bytes=entry.size,
        )

    def another(self, name: str, now: float) -> "LoggedFlight":
        """Prepare for another log of the same flight."""
        return LoggedFlight(
            name=name,
            started_at=self.started_at,
            ended_at=self.ended_at,
            span=self.span,
            armed_at=self.armed_at,
            not_before=now,
            boot=self.boot,
        )


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


def own_logs_of(
    span: FlownSpan,
    others: Iterable[FlownSpan],
    entries: Sequence[LogEntry],
    *,
    has_end_times: bool,
) -> list[LogEntry]:
    """Choose the logs of a flight, without those that rather are of `others`.

    The others are flights after other starts of the vehicle: where its clock has gone back, they
    overlap by it. A log is listed with a time close to the arming of its flight, or to the
    disarming (`has_end_times`).
    """

    def distance_s(entry: LogEntry, flight: FlownSpan) -> float:
        return abs(entry.time_s - (flight.disarmed_s if has_end_times else flight.armed_s))

    foreign = {
        entry
        for other in others
        for entry in logs_of(other, entries, has_end_times=has_end_times)
        if distance_s(entry, other) < distance_s(entry, span)
    }
    found = logs_of(span, entries, has_end_times=has_end_times)
    return [entry for entry in found if entry not in foreign]


class KnownLogs:
    """Since when each log of one vehicle is listed, and which of them were sent.

    A log is recognized by its time and size: its number changes when an older one is deleted, or
    one with an earlier time is added.
    """

    def __init__(self) -> None:
        self._listed: dict[tuple[int, int], float] = {}  # At first, by the broker's clock
        self._sent: deque[tuple[tuple[int, int], int]] = deque(maxlen=SENT_KEPT)

    def take_list(self, entries: Iterable[LogEntry], now: float) -> None:
        """Note a list of the vehicle; the logs that were listed last are remembered."""
        for entry in entries:
            first_at = self._listed.pop(entry[1:], now)
            self._listed[entry[1:]] = first_at
        for forgotten in list(self._listed)[:-LISTED_KEPT]:
            del self._listed[forgotten]

    def sent(self, entry: LogEntry, flight: LoggedFlight) -> None:
        """Note that a log was sent completely for a flight."""
        if flight.boot is not None:
            self._sent.append((entry[1:], flight.boot))

    def possible(self, flight: LoggedFlight, entries: Iterable[LogEntry]) -> list[LogEntry]:
        """Leave out the logs that are of other flights.

        Such a log has not grown since before this flight, or was sent for a flight from which a
        restart of the vehicle separates this one. Flights of one start may share a log.
        """
        return [
            entry
            for entry in entries
            if self._listed.get(entry[1:], math.inf) >= flight.armed_at
            and not any(sent == entry[1:] and boot != flight.boot for sent, boot in self._sent)
        ]


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
