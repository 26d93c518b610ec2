"""The logs that one vehicle writes of its flights, from the landing to the edge server.

A flight, as its vehicle logs it, is from arming to disarming. After it the broker lists the
vehicle's logs until the newest one no longer grows, has the edge server begin one, and then
receives and sends it part by part. The edge server knows how much of a log it has, so the broker
stores nothing and goes on there: after an interruption, and after a restart of either side.

A log matters less than everything else. It is fetched only while the vehicle is connected and
disarmed and has neither mission nor pictures; whatever begins interrupts it at once. One that is
too large, would take too long over the link, or fails repeatedly is given up with a line in the
broker's log.

    waiting    --due-------------> listing    LOG_REQUEST_LIST
    listing    --it grows--------> waiting    for `SETTLE_S`
    listing    --found-----------> asking     the edge server, how much it has
    asking     --answer----------> fetching   LOG_REQUEST_DATA
    fetching   --part complete---> sending    to the edge server
    sending    --answer----------> fetching, or waiting for the next flight
    fetching   --last part-------> checking   that the log still has its number
    any        --interruption----> waiting    LOG_REQUEST_END
"""

import logging
import math
from collections import deque
from collections.abc import Callable, Iterable
from datetime import UTC, datetime, timedelta
from typing import Final

from mavlink_broker.effects import (
    DropLog,
    Effects,
    FindLogs,
    LogJob,
    LogJobDone,
    LogJobFailed,
    LogJobOutcome,
    LogRequest,
    LogState,
    SendLogPart,
)
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.log_download import (
    LogDownload,
    LogEntry,
    LogList,
    LogPart,
    first_byte_request,
)
from mavlink_broker.vehicle.logged_flight import (
    MAX_FAILURES,
    MAX_FLIGHTS,
    FlownSpan,
    IncompleteLogs,
    KnownLogs,
    LoggedFlight,
    flown_unseen_s,
    own_logs_of,
    pause_after_s,
    with_number,
)
from mavlink_broker.vehicle.vehicle import Vehicle

SETTLE_S: Final = 3.0
"""How long after disarming a vehicle may write the end of its log."""
ARDUPILOT_SETTLE_S: Final = 17.0
"""It logs for 15 s after disarming, into another log if this one was read meanwhile."""
SILENT_LISTS: Final = 2
"""Lists without an answer, after which a vehicle is not asked until it restarts."""
LISTS: Final = 5
"""Lists of a log that grows; then it is fetched as it is."""
MEASURED_AFTER_S: Final = 10.0
"""Time after which the rate of the link is known."""
_LOG = logging.getLogger(__name__)


class FlightLogs:
    """The logs of one vehicle; `utc` is set by the loop before each step."""

    def __init__(
        self, vehicle: Vehicle, new_name: Callable[[], str], *, limit_bytes: int, limit_s: float
    ) -> None:
        """`limit_bytes` and `limit_s` bound one log; 0 bytes: none is fetched."""
        self._vehicle = vehicle
        self._new_name = new_name
        self._limit_bytes = limit_bytes
        self._limit_s = limit_s
        self._armed: tuple[datetime, float, float | None] | None = None
        self._boots = 0  # Restarts of the vehicle that were noticed
        self._armed_boot = 0  # How many before it was armed
        self._flights: deque[LoggedFlight] = deque()
        self._current: LoggedFlight | None = None
        self._list: LogList | None = None
        self._is_checking = False
        self._download: LogDownload | None = None
        self._began_at = 0.0  # Of the download
        self._stepped_at: float | None = None
        self._job = 0  # Number of the request that waits for its answer, 0 without one
        self._jobs = 0
        self._incomplete = IncompleteLogs()
        self._unanswered = 0  # Lists in a row that the vehicle has not answered
        self._latest_armed_at = -math.inf
        self._known = KnownLogs()
        self.utc = datetime.fromtimestamp(0, UTC)

    @property
    def is_busy(self) -> bool:
        """Whether messages of the log protocol are expected."""
        return self._list is not None or self._download is not None

    def restarted(self) -> None:
        """Note that the vehicle has restarted: its logs may have other numbers."""
        self._unanswered = 0
        self._boots += 1
        self._postpone_current(0.0)
        for flight in self._flights:
            flight.entry = None

    def forget(self) -> None:
        """Forget the flights of a vehicle that another one has replaced."""
        self.restarted()
        self._flights.clear()
        self._armed = None
        self._known = KnownLogs()

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Handle a message of the log protocol."""
        if self._list is not None:
            self._list.receive(message, now)
        if self._download is not None:
            effects.messages += self._download.receive(message, now)

    def step(self, now: float, effects: Effects, *, may_fetch: bool) -> None:
        """Do what is due; `may_fetch`: nothing more important is to be done on the vehicle."""
        if not self._limit_bytes:
            return
        self._follow_flight(now)
        passed_s = 0.0 if self._stepped_at is None else now - self._stepped_at
        self._stepped_at = now
        if not may_fetch:
            self._interrupt(effects)
        elif self._job:
            return
        elif self._current is None and self._incomplete.is_due(now):
            self._incomplete.ask()
            self._request(FindLogs(), effects)
        elif not self._incomplete.are_known:
            return
        elif self._current is None:
            self._begin_next(now, effects)
        else:
            self._current.fetching_s += passed_s
            self._go_on(self._current, now, effects)

    def take_outcome(self, outcome: LogJobOutcome, now: float, effects: Effects) -> None:
        """Process the answer of the edge server."""
        if outcome.number != self._job:
            return
        self._job = 0
        if self._incomplete.end_question():
            self._take_earlier(outcome, now, effects)
            return
        flight = self._current
        if flight is None:
            return
        match outcome:
            case LogJobFailed():
                self._fail(flight, outcome, now, effects)
            case LogJobDone(_, (state,)):
                self._take_state(flight, state, now, effects)

    # Flights

    def _follow_flight(self, now: float) -> None:
        """Note when the vehicle is armed, and queue its flight when it is disarmed."""
        snapshot = self._vehicle.snapshot
        if snapshot.armed and self._armed is None:
            self._armed = self.utc, now, self._vehicle_utc_s()
            self._armed_boot = self._boots
        elif snapshot.armed and self._armed is not None and self._armed[2] is None:
            # A broker that has just started receives a heartbeat before it knows the clock
            self._armed = *self._armed[:2], self._vehicle_utc_s()
        elif snapshot.armed is False and self._armed is not None:
            (started_at, armed_at, armed_s), self._armed = self._armed, None
            flown_s = flown_unseen_s(self._vehicle)
            started_at = min(started_at, self.utc - timedelta(seconds=flown_s))
            self._latest_armed_at = armed_at
            if self._unanswered >= SILENT_LISTS:
                return
            disarmed_s, booted_s = self._vehicle_utc_s(), snapshot.booted_at_utc_s
            span = None
            if armed_s is not None and disarmed_s is not None and booted_s is not None:
                armed_s = min(armed_s, disarmed_s - flown_s)
                span = FlownSpan(armed_s, max(armed_s, disarmed_s), booted_s)
            self._add(
                LoggedFlight(
                    name=self._new_name(),
                    started_at=started_at,
                    ended_at=max(self.utc, started_at),
                    span=span,
                    armed_at=armed_at,
                    not_before=now + (ARDUPILOT_SETTLE_S if self._is_ardupilot else SETTLE_S),
                    boot=self._armed_boot,
                )
            )

    def _vehicle_utc_s(self) -> float | None:
        snapshot = self._vehicle.snapshot
        if snapshot.booted_at_utc_s is None or snapshot.time_s is None:
            return None
        return snapshot.booted_at_utc_s + snapshot.time_s

    def _add(self, flight: LoggedFlight) -> None:
        self._flights.append(flight)
        if len(self._flights) > MAX_FLIGHTS:
            self._say(self._flights.popleft(), "is given up: too many wait")

    def _take_earlier(self, outcome: LogJobOutcome, now: float, effects: Effects) -> None:
        """Queue what an earlier run of the broker has begun to send; delete what is given up."""
        dropped, begun = self._incomplete.take(outcome, now)
        for name in dropped:
            self._drop(name, effects)
        known = {flight.name for flight in self._flights}
        for log in begun:
            if log.name not in known:
                self._add(
                    LoggedFlight(
                        name=log.name,
                        started_at=log.started_at,
                        ended_at=log.ended_at,
                        span=None,
                        armed_at=now,
                        not_before=now + SETTLE_S,
                        begun=log,
                    )
                )

    def _begin_next(self, now: float, effects: Effects) -> None:
        flight = next((one for one in self._flights if now >= one.not_before), None)
        if flight is not None:
            self._flights.remove(flight)
            self._current = flight
            self._start_list(now, effects)

    def _start_list(self, now: float, effects: Effects) -> None:
        self._list = LogList(self._vehicle.route, self._vehicle.round_trip)
        effects.messages += self._list.start(now)

    # The vehicle

    def _go_on(self, flight: LoggedFlight, now: float, effects: Effects) -> None:
        if self._list is not None:
            effects.messages += self._list.tick(now)
            if self._list.entries is not None:
                self._unanswered = 0 if self._list.is_answered else self._unanswered + 1
                entries, self._list = self._list.entries, None
                if self._is_checking:
                    self._check(flight, entries, now, effects)
                else:
                    self._choose(flight, entries, now, effects)
        elif self._download is not None:
            effects.messages += self._download.tick(now)
            self._follow_download(flight, self._download, now, effects)
        else:
            self._postpone_current(now + pause_after_s(0))

    def _choose(
        self, flight: LoggedFlight, entries: Iterable[LogEntry], now: float, effects: Effects
    ) -> None:
        """Choose the log of the flight; list again while it grows, or is not there yet."""
        entries = [entry for entry in entries if entry.size]
        self._known.take_list(entries, now)
        chosen = self._chosen(flight, entries)
        before, flight.entry = flight.entry, chosen[0] if chosen else None
        flight.lists += 1
        entry = flight.entry
        if entry is None:
            if flight.lists < LISTS and flight.begun is None and not self._unanswered:
                self._postpone_current(now + SETTLE_S)
            else:
                self._give_up(flight, "its vehicle lists no log of it", effects)
            return
        has_settled = before is not None and before[1:] == entry[1:]
        if flight.begun is None and not has_settled and flight.lists < LISTS:
            if self._is_ardupilot:
                effects.messages.append(first_byte_request(entry, self._vehicle.route))
            self._postpone_current(now + SETTLE_S)
            return
        if entry.size > self._limit_bytes:
            reason = f"it has {_mb(entry.size)}, {_mb(self._limit_bytes)} are the limit"
            self._give_up(flight, reason, effects)
            return
        if flight.begun is None:
            form = "bin" if self._is_ardupilot else "ulg"
            flight.begun = flight.log(entry, form)
            for one in chosen[1:]:
                another = flight.another(self._new_name(), now)
                another.begun = another.log(one, form)
                self._add(another)
        self._request(flight.begun, effects)

    def _chosen(self, flight: LoggedFlight, entries: list[LogEntry]) -> list[LogEntry]:
        """Choose the logs of a flight, newest first."""
        if flight.begun is not None:
            log = flight.begun
            return [
                entry
                for entry in entries
                if entry.time_s == log.listed_s and entry.size >= log.size_bytes
            ]
        possible = self._known.possible(flight, entries)
        if flight.span is not None and any(entry.time_s for entry in entries):
            others = [one.span for one in self._flights if one.span and one.boot != flight.boot]
            has_end_times = self._vehicle.family.lists_log_ends
            found = own_logs_of(flight.span, others, possible, has_end_times=has_end_times)
            if self._is_ardupilot and not found:  # Some cards keep the time of the beginning
                found = own_logs_of(flight.span, others, possible, has_end_times=False)
        else:  # Without a clock the newest log is of the latest flight
            is_latest = flight.armed_at == self._latest_armed_at
            newest = max(entries, default=None)
            found = [newest] if is_latest and newest in possible else []
        if flight.entry is not None and self._is_ardupilot:
            found = with_number(flight.entry, possible, found)
        return found

    @property
    def _is_ardupilot(self) -> bool:
        return bool(self._vehicle.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)

    def _follow_download(
        self, flight: LoggedFlight, download: LogDownload, now: float, effects: Effects
    ) -> None:
        part = download.part
        if download.failure is not None:
            self._end_download(effects)
            self._retry(flight, download.failure, now, effects)
        elif part is not None and part.is_last:
            self._is_checking = True
            self._start_list(now, effects)
        elif part is not None:
            self._send(flight, part, effects)
        elif reason := self._excess(flight, download, now):
            self._end_download(effects)
            self._give_up(flight, reason, effects)

    def _excess(self, flight: LoggedFlight, download: LogDownload, now: float) -> str | None:
        """Why a log takes too long over this link; None if it does not."""
        if flight.fetching_s > self._limit_s:
            return f"it takes longer than {self._limit_s:.0f} s"
        elapsed_s = now - self._began_at
        if elapsed_s < MEASURED_AFTER_S or not download.received:
            return None
        left_s = download.left_bytes / download.received * elapsed_s
        if flight.fetching_s + left_s <= self._limit_s:
            return None
        rate = download.received / elapsed_s / 1e3
        return (
            f"it would take {left_s:.0f} s over this link ({rate:.1f} kB/s), "
            f"{self._limit_s:.0f} s are the limit"
        )

    def _check(
        self, flight: LoggedFlight, entries: Iterable[LogEntry], now: float, effects: Effects
    ) -> None:
        """Send the last part if the log still has its number, else nothing of it is relied upon."""
        self._is_checking = False
        entry, download = flight.entry, self._download
        part = None if download is None else download.part
        if entry is None or part is None:
            self._postpone_current(now)
            return
        if any(one[:2] == entry[:2] and one.size >= entry.size for one in entries):
            self._send(flight, part, effects)
            return
        self._end_download(effects)
        self._drop(flight.name, effects)
        flight.name, flight.begun = self._new_name(), None
        self._retry(flight, "the vehicle has numbered its logs again", now, effects)

    def _interrupt(self, effects: Effects) -> None:
        """Stop at once; the flight's log waits."""
        if self.is_busy:
            self._end_download(effects)
        self._postpone_current(0.0)

    def _end_download(self, effects: Effects) -> None:
        route = self._vehicle.route
        effects.messages.append(mavlink.MAVLink_log_request_end_message(*route.target))
        self._download = self._list = None
        self._is_checking = False

    def _postpone_current(self, not_before: float) -> None:
        flight, self._current = self._current, None
        self._download = self._list = None
        self._is_checking = False
        if flight is not None:
            flight.not_before = max(flight.not_before, not_before)
            self._flights.appendleft(flight)

    # The edge server

    def _request(self, request: LogRequest, effects: Effects) -> None:
        self._jobs += 1
        self._job = self._jobs
        effects.jobs.append(LogJob(self._job, self._vehicle.vehicle_id, request))

    def _send(self, flight: LoggedFlight, part: LogPart, effects: Effects) -> None:
        self._request(SendLogPart(flight.name, *part), effects)

    def _take_state(
        self, flight: LoggedFlight, state: LogState, now: float, effects: Effects
    ) -> None:
        """Go on behind what the edge server has."""
        entry = flight.entry
        if state.is_complete or entry is None:
            if self._download is not None:
                self._end_download(effects)
            self._finish(flight, state)
        elif self._download is None:
            self._began_at = now
            fetched = entry._replace(size=state.log.size_bytes)
            self._download = LogDownload(
                fetched,
                self._vehicle.route,
                offset=state.received_bytes,
                reopens=self._vehicle.family.keeps_log_open,
            )
            effects.messages += self._download.tick(now)
        else:
            effects.messages += self._download.proceed(now)

    def _finish(self, flight: LoggedFlight, state: LogState) -> None:
        self._current = None
        if flight.entry is not None:
            self._known.sent(flight.entry, flight)
        _LOG.info(
            "vehicle %d: the log of its flight, %s, was sent after %.0f s",
            *(self._vehicle.vehicle_id, _mb(state.received_bytes), flight.fetching_s),
        )

    def _fail(
        self, flight: LoggedFlight, failed: LogJobFailed, now: float, effects: Effects
    ) -> None:
        if self._download is not None:
            self._end_download(effects)
        if failed.is_final:
            self._incomplete.drop(flight.name)
            flight.begun = None  # The edge server has none of it, or keeps it no longer
            self._give_up(flight, failed.reason, effects)
        else:
            self._retry(flight, failed.reason, now, effects, is_counted=not failed.is_temporary)

    def _retry(
        self,
        flight: LoggedFlight,
        reason: str,
        now: float,
        effects: Effects,
        *,
        is_counted: bool = True,
    ) -> None:
        flight.failures += is_counted
        if flight.failures >= MAX_FAILURES:
            self._give_up(flight, reason, effects)
            return
        pause_s = pause_after_s(flight.failures)
        _LOG.info(
            "vehicle %d: the log of its flight waits for %.0f s: %s",
            *(self._vehicle.vehicle_id, pause_s, reason),
        )
        self._postpone_current(now + pause_s)

    def _give_up(self, flight: LoggedFlight, reason: str, effects: Effects) -> None:
        self._current = None
        self._say(flight, f"is given up: {reason}")
        if flight.begun is not None:
            self._drop(flight.name, effects)

    def _drop(self, name: str, effects: Effects) -> None:
        """Delete what the edge server has of a log; one that stays is found again."""
        self._incomplete.drop(name)
        self._jobs += 1  # Its answer is of no interest
        effects.jobs.append(LogJob(self._jobs, self._vehicle.vehicle_id, DropLog(name)))

    def _say(self, flight: LoggedFlight, what: str) -> None:
        _LOG.warning(
            "vehicle %d: the log of its flight from %s to %s %s",
            *(self._vehicle.vehicle_id, f"{flight.started_at:%H:%M:%S}"),
            *(f"{flight.ended_at:%H:%M:%S}", what),
        )


def _mb(size: int) -> str:
    return f"{size / 1e6:.1f} MB"
