"""Has the frame log of each flight of one vehicle sent to the edge server after the landing.

A flight is from arming to disarming. A worker thread copies its frames and sends them; what it
cannot send now is retried, less and less often, and given up with a line in the log. The vehicle
takes no part in it: frames of a vehicle that was restarted or replaced meanwhile are sent too.
"""

import logging
from collections import deque
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Final

from mavlink_broker.effects import (
    Effects,
    FramesNotSent,
    FramesOutcome,
    FrameSpan,
    FramesSent,
    SendFrames,
)
from mavlink_broker.vehicle.logged_flight import (
    MAX_FAILURES,
    MAX_FLIGHTS,
    flown_unseen_s,
    pause_after_s,
)
from mavlink_broker.vehicle.vehicle import Vehicle

SETTLE_S: Final = 5.0
"""Time in which the last frames are written, and the edge server receives the end of the flight."""
_LOG = logging.getLogger(__name__)


class FlightFrames:
    """The flights of one vehicle whose frames wait to be sent."""

    def __init__(self, vehicle: Vehicle, new_name: Callable[[], str], *, limit_bytes: int) -> None:
        """`limit_bytes` bound one flight; 0: none is sent."""
        self._vehicle = vehicle
        self._new_name = new_name
        self._limit_bytes = limit_bytes
        self._armed_at: datetime | None = None
        self._waiting: deque[FrameSpan | None] = deque([None])  # None: what an earlier run began
        self._job = 0  # Number of the job in progress, 0 without one
        self._jobs = 0
        self._failures = 0
        self._not_before = 0.0

    def step(self, now: float, utc: datetime, effects: Effects) -> None:
        """Note the beginning and end of flights, and have the next one sent when it is due."""
        if not self._limit_bytes:
            return
        self._follow_flight(now, utc)
        if self._waiting and not self._job and now >= self._not_before:
            self._jobs += 1
            self._job = self._jobs
            vehicle = self._vehicle
            effects.jobs.append(
                SendFrames(
                    self._job,
                    vehicle.vehicle_id,
                    vehicle.route.target_system,
                    self._waiting[0],
                    self._limit_bytes,
                )
            )

    def take_outcome(self, outcome: FramesOutcome, now: float) -> None:
        """Go on to the next flight, or try this one again later."""
        if outcome.number != self._job:
            return
        self._job = 0
        match outcome:
            case FramesSent():
                self._finish(outcome)
            case FramesNotSent():
                self._fail(outcome, now)

    def _follow_flight(self, now: float, utc: datetime) -> None:
        armed = self._vehicle.snapshot.armed
        if armed and self._armed_at is None:
            self._armed_at = utc
        elif armed is False and self._armed_at is not None:
            began_at = utc - timedelta(seconds=flown_unseen_s(self._vehicle))
            started_at, self._armed_at = min(self._armed_at, began_at), None
            self._waiting.append(FrameSpan(self._new_name(), started_at, max(utc, started_at)))
            self._not_before = max(self._not_before, now + SETTLE_S)
            if len(self._waiting) > MAX_FLIGHTS:
                self._forget_oldest()

    def _forget_oldest(self) -> None:
        """Forget the flight that waits longest, but not one that is being sent."""
        oldest = 1 if self._job else 0
        self._warn(self._waiting[oldest], "too many wait")
        del self._waiting[oldest]
        if not self._job:
            self._failures = 0

    def _finish(self, sent: FramesSent) -> None:
        flight = self._waiting.popleft()
        self._failures = 0
        if flight is not None or sent.size_bytes:
            _LOG.info(
                "vehicle %d: the frames of its flight, %.1f MB, were sent",
                *(self._vehicle.vehicle_id, sent.size_bytes / 1e6),
            )

    def _fail(self, failed: FramesNotSent, now: float) -> None:
        self._failures += not failed.is_temporary
        if failed.is_final or self._failures >= MAX_FAILURES:
            self._failures = 0
            self._warn(self._waiting.popleft(), failed.reason)
            return
        self._not_before = now + pause_after_s(self._failures)

    def _warn(self, flight: FrameSpan | None, reason: str) -> None:
        which = (
            "of an earlier run" if flight is None else f"that began at {flight.started_at:%H:%M:%S}"
        )
        _LOG.warning(
            "vehicle %d: the frames of its flight %s are not sent: %s",
            *(self._vehicle.vehicle_id, which, reason),
        )
